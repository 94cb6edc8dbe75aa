#version 460
#extension GL_GOOGLE_include_directive : require
#include "bench.glsl"

// For spheres and linear swept spheres: the normal from the ends, that the shader looks up itself.

layout(location = 0) rayPayloadInEXT vec4 colour;
hitAttributeEXT vec2 attributes;

void main() {
    vec4 first = spheres[2 * gl_PrimitiveID];
    vec4 second = spheres[2 * gl_PrimitiveID + 1];
    vec3 at = gl_ObjectRayOriginEXT + gl_ObjectRayDirectionEXT * gl_HitTEXT;
    vec3 normal = normalize((at - mix(first.xyz, second.xyz, attributes.x)) * mat3(gl_WorldToObjectEXT));
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
