#version 460
#extension GL_GOOGLE_include_directive : require
#include "bench.glsl"

// Six octaves of noise bend the normal and choose the colour.

layout(location = 0) rayPayloadInEXT vec4 colour;
hitAttributeEXT vec2 barycentrics;

void main() {
    vec3 normal = normalize(smooth_normal(gl_PrimitiveID, barycentrics) * mat3(gl_WorldToObjectEXT));
    vec3 at = (gl_WorldRayOriginEXT + gl_WorldRayDirectionEXT * gl_HitTEXT) * 4.0;
    float weight = 0.5;
    float sum = 0.0;
    for (int octave = 0; octave < 6; octave++) {
        sum += weight * noise(at);
        at = at.zxy * 2.02 + vec3(1.7, 9.2, 3.1);
        weight *= 0.5;
    }
    normal = normalize(normal + 0.3 * (sum - 0.5) * vec3(0.57, 0.57, -0.57));
    float diffuse = max(dot(normal, inputs.light.xyz), 0.0);
    vec3 halfway = normalize(inputs.light.xyz - gl_WorldRayDirectionEXT);
    float highlight = pow(max(dot(normal, halfway), 0.0), 24.0);
    vec3 albedo = mix(vec3(0.35, 0.25, 0.15), vec3(0.2, 0.5, 0.15), sum);
    colour = vec4(lit(albedo, diffuse, highlight, gl_HitTEXT), gl_HitTEXT);
}
