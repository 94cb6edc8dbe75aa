#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 1) rayPayloadInEXT float sun;

void main() {
    sun = 1.0;
}
