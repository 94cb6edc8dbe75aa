#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// What the ray found.

struct Found {
    float t;
    uint steps;
};

layout(location = 0) rayPayloadInEXT Found found;
hitAttributeEXT uint taken;

void main() {
    found.t = gl_HitTEXT;
    found.steps = taken;
}
