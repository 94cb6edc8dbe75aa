#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "payload.glsl"

// Bounces upwards once more, with the payload that it was given: recursion to depth 2.

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    vec3 at = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    uint depth = payload.depth;
    payload.bounces[depth] = Bounce(at, gl_PrimitiveID);
    payload.path[depth] = gl_HitTEXT;
    payload.counts.x += 1;
    payload.turned = payload.turned * mat2(0.0, 1.0, -1.0, 0.0);
    payload.depth = depth + 1u;
    if (depth == 0u) {
        traceRayEXT(scene, gl_RayFlagsOpaqueEXT, 0xFF, 0, 0, 0, at, 0.01, vec3(1.0, 0.0, 0.0), 100.0, 0);
    }
    payload.path[3] += 1.0;
}
