#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -gVS

layout(location = 0) rayPayloadInEXT float payload;

void main() {
    payload = gl_HitTEXT;
}
