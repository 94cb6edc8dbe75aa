#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 0) rayPayloadInEXT vec3 normal;
hitAttributeEXT vec3 from_middle;

const uint INSIDE = 2u;

void main() {
    normal = gl_HitKindEXT == INSIDE ? -from_middle : from_middle;
}
