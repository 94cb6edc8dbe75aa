#version 460
#extension GL_EXT_ray_tracing : require

struct Payload {
    vec3 colour;
    float t;
};

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.colour = vec3(0.25);
}
