#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// Closest hit: the colour fades with the width of the ray's cone.

struct Path {
    vec3 radiance;
    float cone_width;
};
layout(location = 0) rayPayloadInEXT Path path;

void main() {
    path.radiance = vec3(1.0) / (1.0 + path.cone_width * gl_HitTEXT);
}
