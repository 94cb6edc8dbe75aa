#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
//@ flags: -g
#include "scene.glsl"

layout(location = 1) rayPayloadInEXT Shadow shadow;

void main() {
    shadow.light = 1.0;
}
