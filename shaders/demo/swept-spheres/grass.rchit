#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_linear_swept_spheres : require
#extension GL_GOOGLE_include_directive : require
//@ flags: -g
//@ also gVS: -gVS
#define HIT_SHADER
#include "scene.glsl"
#include "normals.glsl"
#include "shade.glsl"

// Blades of grass: dark at the root, each with its own tint.

hitAttributeEXT float u;

void main() {
    vec3 hit = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    float along = u * 0.75 + tint(gl_PrimitiveID) * 0.25;
    vec3 albedo = material(along, BAND_GRASS) * (0.4 + 0.6 * u);
    payload.colour = shade(hit, world_normal(u), albedo, 0.05);
}
