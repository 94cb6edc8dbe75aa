#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(set = 0, binding = 2, std430) readonly buffer Materials { vec4 materials[]; };
layout(location = 0) rayPayloadInEXT vec3 color;

void main() {
    uint material = gl_InstanceCustomIndexEXT;
    color = materials[material].rgb;
}
