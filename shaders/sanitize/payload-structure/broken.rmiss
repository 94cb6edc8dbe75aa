#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// The sky.

struct Hit {
    vec3 color;
    vec3 normal;
    float distance; // negative in the sky
};

layout(location = 0) rayPayloadInEXT Hit hit;

void main() {
    hit.color = vec3(0.25, 0.5, 1.0);
    hit.normal = vec3(0.0);
    hit.distance = -1.0;
}
