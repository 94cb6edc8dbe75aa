#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_debug_printf : require
#extension GL_GOOGLE_include_directive : require
#include "payload.glsl"
//@ flags: -g

// A mistake: the normal points along the ray, and so the shadow ray begins behind the wall and meets
// it again.

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) rayPayloadInEXT Payload payload;
layout(location = 1) rayPayloadEXT float shadow;

void main() {
    vec3 at = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    vec3 normal = vec3(0.0, 0.0, -1.0);
    uint flags = gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;
    shadow = 0.0;
    traceRayEXT(scene, flags, 0xFF, 0, 0, 1, at + normal * 0.0001, 0.0, vec3(0.0, 0.0, 1.0), 100.0, 1);
    if (at.x == 1.0 && at.y == 2.0) {
        debugPrintfEXT("shadow %f", shadow);
    }
    payload.light = shadow * abs(normal.z);
    payload.bounces += 1u;
}
