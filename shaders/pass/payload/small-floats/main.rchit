#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_bfloat16 : require
#extension GL_EXT_float_e4m3 : require
#extension GL_EXT_float_e5m2 : require
#include "payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.weight = bfloat16_t(float(payload.weight) * gl_HitTEXT);
    payload.tint[1] = floate4m3_t(gl_HitTEXT);
    payload.parts.y = fe5m2vec3(payload.parts).z;
    payload.t = gl_HitTEXT;
}
