#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -gVS

struct Payload {
    vec3 colour;
    float light;
};

layout(location = 0) rayPayloadInEXT Payload payload;

// Of shadow rays.
void main() {
    payload.light = 0.0;
}
