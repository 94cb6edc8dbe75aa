#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// A wall that glows a little, and gets light from its surroundings as long as the path is short.

struct Path {
    vec3 radiance;
    uint bounces;
};

layout(location = 0) rayPayloadInEXT Path path;

const uint MOST_BOUNCES = 4u;
const vec3 GLOW = vec3(0.125, 0.0, 0.0);
const vec3 ALBEDO = vec3(0.5, 0.25, 0.25);
const vec3 SURROUNDINGS = vec3(0.5);

void main() {
    path.radiance = GLOW;
    if (path.bounces < MOST_BOUNCES) {
        path.radiance += ALBEDO * SURROUNDINGS;
    }
}
