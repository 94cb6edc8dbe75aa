#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "result.glsl"

layout(location = 0) rayPayloadInEXT Result result;

void main() {
    result.hits = 0.0;
}
