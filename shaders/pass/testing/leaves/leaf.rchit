#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "payload.glsl"
//@ flags: -g

// Leaves are violet, and red where they are far away.

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.t = gl_HitTEXT;
    payload.colour = vec3(0.5, 0.25, 1.0);
    if (gl_HitTEXT > 50.0) {
        payload.colour = vec3(1.0, 0.0, 0.0);
    }
}
