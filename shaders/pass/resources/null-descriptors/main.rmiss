#version 460
#extension GL_EXT_ray_tracing : require

// A miss.

layout(location = 0) rayPayloadInEXT uint payload;

void main() {
    payload = 4u;
}
