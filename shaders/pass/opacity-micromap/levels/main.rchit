#version 460
#extension GL_EXT_ray_tracing : require

// An opaque hit, unless the any-hit shader was asked.

layout(location = 0) rayPayloadInEXT uint payload;

void main() {
    payload = payload == 0u ? 2u : payload;
}
