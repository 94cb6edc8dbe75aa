#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// The sky.

struct Path {
    vec3 radiance;
    float cone_width;
};
layout(location = 0) rayPayloadInEXT Path path;

void main() {
    path.radiance = vec3(0.5, 0.7, 1.0);
}
