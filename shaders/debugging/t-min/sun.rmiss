#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -gVS

layout(location = 1) rayPayloadInEXT float light;

void main() {
    light = 1.0;
}
