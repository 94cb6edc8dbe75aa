#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -gVS

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) rayPayloadInEXT vec3 colour;
layout(location = 1) rayPayloadEXT float light;

const vec3 TO_SUN = vec3(0.6, 0.8, 0.0);
const uint SHADOW_FLAGS = gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;

void main() {
    vec3 hit = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    light = 0.0;
    traceRayEXT(scene, SHADOW_FLAGS, 0xFF, 0, 0, 1, hit, 0.0, TO_SUN, 100.0, 1);
    colour = vec3(0.5, 0.75, 0.5) * (0.125 + light);
}
