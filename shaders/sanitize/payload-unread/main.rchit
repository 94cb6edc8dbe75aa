#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 0) rayPayloadInEXT vec3 colour;

void main() {
    colour = vec3(0.5, 0.25, 1.0);
}
