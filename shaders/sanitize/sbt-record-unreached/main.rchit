#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 0) rayPayloadInEXT float depth;

void main() {
    depth = gl_HitTEXT;
}
