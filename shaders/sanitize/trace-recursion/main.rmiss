#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

struct Path {
    vec3 color;
    uint depth;
};

layout(location = 0) rayPayloadInEXT Path path;

void main() {
    path.color = vec3(0.25, 0.5, 1.0);
}
