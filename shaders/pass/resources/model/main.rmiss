#version 460
#extension GL_GOOGLE_include_directive : require
#include "model.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.colour = vec3(0.0);
    payload.feature = 0;
}
