#version 460
#extension GL_EXT_ray_tracing : require

// Notes what was hit.

struct Payload { uint ignores; uint seen; uint order; uint closest; };
layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    uint which = uint(gl_InstanceID * 4 + gl_GeometryIndexEXT * 2 + gl_PrimitiveID);
    payload.closest = which;
}
