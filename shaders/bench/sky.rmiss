#version 460
#extension GL_GOOGLE_include_directive : require
#include "bench.glsl"

layout(location = 0) rayPayloadInEXT vec4 colour;

void main() { colour = vec4(sky(gl_WorldRayDirectionEXT), -1.0); }
