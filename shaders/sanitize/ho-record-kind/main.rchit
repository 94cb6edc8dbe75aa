#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// Light from above, on the normal that the caller has found.

layout(location = 0) rayPayloadInEXT float depth;
hitAttributeEXT vec3 normal;

void main() {
    depth = max(normal.y, 0.0);
}
