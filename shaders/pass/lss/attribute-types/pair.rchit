#version 460
#extension GL_EXT_ray_tracing : require

// Two.

layout(location = 0) rayPayloadInEXT vec2 payload;
hitAttributeEXT vec2 u;

void main() {
    payload = u;
}
