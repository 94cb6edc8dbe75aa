#version 460
#extension GL_EXT_ray_tracing : require

// A struct of one.

layout(location = 0) rayPayloadInEXT vec2 payload;
struct Attributes { float u; };
hitAttributeEXT Attributes attributes;

void main() {
    payload = vec2(attributes.u, 9.0);
}
