#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 0) rayPayloadInEXT float distance_hit;

void main() {
    distance_hit = -1.0;
}
