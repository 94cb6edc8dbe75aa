#version 460
#extension GL_EXT_ray_tracing : require

// None at all.

layout(location = 0) rayPayloadInEXT vec2 payload;


void main() {
    payload = vec2(8.0, 9.0);
}
