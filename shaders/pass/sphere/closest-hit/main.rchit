#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_linear_swept_spheres : require
#extension GL_GOOGLE_include_directive : require
#include "payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    vec3 hit = gl_ObjectRayOriginEXT + gl_HitTEXT * gl_ObjectRayDirectionEXT;
    payload.normal = (hit - gl_HitSpherePositionNV) / gl_HitSphereRadiusNV;
    payload.t = gl_HitTEXT;
    payload.hits += 1u;
}
