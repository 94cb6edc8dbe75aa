#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// The color of a ball, darker where it is seen from inside.

layout(location = 0) rayPayloadInEXT vec3 color;

const uint INSIDE = 1u;

void main() {
    color = gl_HitKindEXT == INSIDE ? vec3(0.25) : vec3(0.75);
}
