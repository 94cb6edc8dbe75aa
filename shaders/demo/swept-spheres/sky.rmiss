#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
//@ flags: -g
#include "scene.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.colour = sky(gl_WorldRayDirectionEXT);
}
