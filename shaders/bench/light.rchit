#version 460
#extension GL_GOOGLE_include_directive : require
#include "bench.glsl"

// A smooth normal, Lambert, a highlight by multiplication.

layout(location = 0) rayPayloadInEXT vec4 colour;
hitAttributeEXT vec2 barycentrics;

void main() {
    vec3 normal = normalize(smooth_normal(gl_PrimitiveID, barycentrics) * mat3(gl_WorldToObjectEXT));
    float diffuse = max(dot(normal, inputs.light.xyz), 0.0);
    vec3 halfway = normalize(inputs.light.xyz - gl_WorldRayDirectionEXT);
    float highlight = max(dot(normal, halfway), 0.0);
    for (int doubling = 0; doubling < 4; doubling++) {
        highlight *= highlight;
    }
    vec3 albedo = mix(vec3(0.35, 0.25, 0.15), vec3(0.2, 0.5, 0.15), normal.y);
    colour = vec4(lit(albedo, diffuse, highlight, gl_HitTEXT), gl_HitTEXT);
}
