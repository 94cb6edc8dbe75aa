#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "payload.glsl"
//@ flags: -g

// The sky is grey.

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.t = -1.0;
    payload.colour = vec3(0.25);
}
