#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -gVS

struct Payload {
    vec3 colour;
    float distance;
};

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.colour = vec3(1.0, 0.0, 0.0);
    payload.distance = gl_HitTEXT;
}
