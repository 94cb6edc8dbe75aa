#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
//@ flags: -g
#include "scene.glsl"
#include "shade.glsl"

// The ground plane: a chequered pattern of the image's tints, seen from above.

void main() {
    vec3 hit = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    vec2 cell = floor(hit.xz * 2.0);
    float odd = fract((cell.x + cell.y) * 0.5) * 2.0;
    vec2 within = fract(hit.xz * 2.0);
    vec3 albedo = material(within.x * 0.5 + odd * 0.5, BAND_GROUND) * (0.75 + 0.25 * within.y);
    vec3 normal = normalize((vec3(0.0, 1.0, 0.0) * gl_WorldToObjectEXT).xyz);
    payload.colour = shade(hit, normal, albedo, 0.0);
}
