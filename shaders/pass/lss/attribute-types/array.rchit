#version 460
#extension GL_EXT_ray_tracing : require

// An array.

layout(location = 0) rayPayloadInEXT vec2 payload;
hitAttributeEXT float u[2];

void main() {
    payload = vec2(u[0], u[1]);
}
