#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// Whether the sun shines on the point that was hit.

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) rayPayloadInEXT float lit;
layout(location = 1) rayPayloadEXT float sun;

void main() {
    vec3 at = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    sun = 0.0;
    uint flags = gl_RayFlagsOpaqueEXT | gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;
    traceRayEXT(scene, flags, 0xFF, 0, 0, 1, at, 0.0, vec3(0.5, 0.25, 1.0), 100.0, 1);
    lit = sun;
}
