#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// The background is black: there is nothing to add.

struct Layers {
    uint count;
    float t[4];
    vec4 color[4];
};

layout(location = 0) rayPayloadInEXT Layers layers;

void main() {}
