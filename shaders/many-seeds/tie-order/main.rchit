#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

struct Surface {
    float t;
    vec3 color;
};

layout(shaderRecordEXT, std430) buffer Paint {
    vec4 color;
};
layout(location = 0) rayPayloadInEXT Surface surface;

void main() {
    surface.t = gl_HitTEXT;
    surface.color = color.rgb;
}
