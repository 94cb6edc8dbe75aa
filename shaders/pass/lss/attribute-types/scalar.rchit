#version 460
#extension GL_EXT_ray_tracing : require

// A float.

layout(location = 0) rayPayloadInEXT vec2 payload;
hitAttributeEXT float u;

void main() {
    payload = vec2(u, 9.0);
}
