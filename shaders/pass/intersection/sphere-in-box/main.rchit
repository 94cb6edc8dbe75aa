#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "hit.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT Attributes attributes;

void main() {
    payload.normal = attributes.normal;
    payload.t = gl_HitTEXT;
    payload.kind = gl_HitKindEXT;
    payload.primitive = gl_PrimitiveID;
    payload.root = attributes.root;
}
