#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 0) rayPayloadInEXT float distance_;

void main() {
    distance_ = gl_HitTEXT;
}
