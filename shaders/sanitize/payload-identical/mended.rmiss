#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// The sky.

struct Payload {
    vec3 color;
    float distance;
};

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.color = vec3(0.25, 0.5, 1.0);
}
