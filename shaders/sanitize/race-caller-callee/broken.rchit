#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// Closest hit: the colour fades with the width of the ray's cone.

layout(set = 0, binding = 2, std430) buffer Cones { float cone_width[]; };
layout(location = 0) rayPayloadInEXT vec3 radiance;

void main() {
    uint index = gl_LaunchIDEXT.y * gl_LaunchSizeEXT.x + gl_LaunchIDEXT.x;
    radiance = vec3(1.0) / (1.0 + cone_width[index] * gl_HitTEXT);
}
