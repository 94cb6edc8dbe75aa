#version 460
#extension GL_EXT_ray_tracing : require

// Reads an image before and behind a call.

layout(set = 0, binding = 3) uniform texture2D plain;
layout(set = 0, binding = 4) uniform sampler nearest;
layout(location = 0) rayPayloadInEXT float payload;
layout(location = 1) callableDataEXT float data;

void main() {
    vec2 at = vec2(0.75, 0.5);
    float before = texture(sampler2D(plain, nearest), at).x;
    data = before;
    executeCallableEXT(0, 1);
    payload = data + texture(sampler2D(plain, nearest), at).x - before;
}
