#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_linear_swept_spheres : require
#extension GL_GOOGLE_include_directive : require
//@ flags: -g
#include "scene.glsl"
#include "shade.glsl"

// Spheres: the image wraps around each by longitude.

void main() {
    vec3 object = gl_ObjectRayOriginEXT + gl_HitTEXT * gl_ObjectRayDirectionEXT;
    vec3 from_centre = object - gl_HitSpherePositionNV;
    vec3 normal = normalize((from_centre * gl_WorldToObjectEXT).xyz);
    vec3 hit = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    float longitude = atan(from_centre.z, from_centre.x) * 0.15915494309189535 + 0.5;
    float along = fract(longitude + tint(gl_PrimitiveID));
    vec3 albedo = material(along, BAND_SPHERES) * (1.1 - gl_HitSphereRadiusNV);
    payload.colour = shade(hit, normal, albedo, 0.6);
}
