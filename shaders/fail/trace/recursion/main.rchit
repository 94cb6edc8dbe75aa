#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) rayPayloadInEXT uint depth;

void main() {
    depth += 1u;
    vec3 hit = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    traceRayEXT(scene, gl_RayFlagsOpaqueEXT, 0xFF, 0, 0, 0, hit, 0.001, -gl_WorldRayDirectionEXT, 100.0, 0);
}
