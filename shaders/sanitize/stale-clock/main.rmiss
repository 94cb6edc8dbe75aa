#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// What the ray costs counts, not what it finds.

layout(location = 0) rayPayloadInEXT uint lit;

void main() {
}
