#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_linear_swept_spheres : require
#extension GL_GOOGLE_include_directive : require
//@ flags: -g
#define HIT_SHADER
#include "scene.glsl"
#include "normals.glsl"
#include "shade.glsl"

// Chains of four segments: the image's tints run along each segment, thicker parts are darker.

hitAttributeEXT float u;

void main() {
    vec3 hit = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    float segment = float(gl_PrimitiveID % 4);
    float radius = mix(gl_HitLSSRadiiNV[0], gl_HitLSSRadiiNV[1], u);
    vec3 albedo = material((segment + u) * 0.25, BAND_CHAINS) * (1.0 - radius);
    payload.colour = shade(hit, world_normal(u), albedo, 0.4);
}
