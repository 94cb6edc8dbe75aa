#version 460
#extension GL_EXT_ray_tracing : require

// Hands the payload to a callable shader.

layout(location = 0) rayPayloadInEXT uvec2 payload;
layout(location = 1) callableDataEXT uvec2 data;

void main() {
    data = payload + uvec2(100u, 0u);
    executeCallableEXT(1, 1);
    payload = data;
}
