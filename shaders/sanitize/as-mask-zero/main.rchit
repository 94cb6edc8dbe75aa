#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 0) rayPayloadInEXT float height;

void main() {
    height = gl_WorldRayOriginEXT.y - gl_HitTEXT;
}
