#version 460
#extension GL_EXT_ray_tracing : require

// A struct of two.

layout(location = 0) rayPayloadInEXT vec2 payload;
struct Attributes { vec2 u; };
hitAttributeEXT Attributes attributes;

void main() {
    payload = attributes.u;
}
