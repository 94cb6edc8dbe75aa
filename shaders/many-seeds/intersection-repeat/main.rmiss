#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

struct Found {
    float t;
    uint steps;
};

layout(location = 0) rayPayloadInEXT Found found;

void main() {
    found.t = 8.0;
    found.steps = 0u;
}
