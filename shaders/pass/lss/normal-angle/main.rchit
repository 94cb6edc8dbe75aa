#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_linear_swept_spheres : require
#extension GL_GOOGLE_include_directive : require
#include "result.glsl"
#include "../../../demo/swept-spheres/normals.glsl"

// Both normals of the demo side by side, and the angle between them beside what geometry says of it.

layout(location = 0) rayPayloadInEXT Result result;
hitAttributeEXT float u;

void main() {
    vec3 p0 = gl_HitLSSPositionsNV[0];
    vec3 p1 = gl_HitLSSPositionsNV[1];
    float r0 = gl_HitLSSRadiiNV[0];
    float r1 = gl_HitLSSRadiiNV[1];
    vec3 hit = gl_ObjectRayOriginEXT + gl_HitTEXT * gl_ObjectRayDirectionEXT;
    vec3 to_surface = exact_normal(hit, p0, p1, u);
    result.exact = normalize(to_surface);
    result.projected = normalize(projected_normal(hit, p0, p1));
    result.u = u;
    result.t = gl_HitTEXT;
    // acos of the dot product would lose half the digits of a small angle.
    vec3 crossed = cross(result.exact, result.projected);
    result.angle = atan(length(crossed), dot(result.exact, result.projected));
    result.expected = asin(abs(r0 - r1) / length(p1 - p0));
    result.off_sphere = length(to_surface) - mix(r0, r1, u);
    result.hits += 1.0;
}
