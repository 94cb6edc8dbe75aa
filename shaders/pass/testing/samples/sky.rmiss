#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "payload.glsl"
//@ flags: -g

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.light = 1.0;
}
