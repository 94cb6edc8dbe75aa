#version 460
#extension GL_GOOGLE_include_directive : require
#include "bench.glsl"

// A normal that the intersection shader has left, a colour by the primitive.

layout(location = 0) rayPayloadInEXT vec4 colour;
hitAttributeEXT vec4 outward;

void main() {
    vec3 normal = normalize(outward.xyz * mat3(gl_WorldToObjectEXT));
    float diffuse = max(dot(normal, inputs.light.xyz), 0.0);
    vec3 halfway = normalize(inputs.light.xyz - gl_WorldRayDirectionEXT);
    float highlight = max(dot(normal, halfway), 0.0);
    for (int doubling = 0; doubling < 4; doubling++) {
        highlight *= highlight;
    }
    uint number = gl_PrimitiveID;
    vec3 albedo = 0.3 + 0.7 * vec3(unit_interval(number), unit_interval(number + 77777u), 0.4);
    colour = vec4(lit(albedo, diffuse, highlight, gl_HitTEXT), gl_HitTEXT);
}
