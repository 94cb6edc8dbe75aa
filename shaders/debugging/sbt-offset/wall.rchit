#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -gVS

struct Payload {
    vec3 colour;
    float light;
};

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.colour = vec3(0.5, 0.25, 0.125);
}
