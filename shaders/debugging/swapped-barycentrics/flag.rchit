#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -gVS

layout(set = 0, binding = 2, std430) readonly buffer Colours { vec4 corners[]; };
layout(location = 0) rayPayloadInEXT vec3 colour;
hitAttributeEXT vec2 attributes;

void main() {
    float u = attributes.x;
    float v = attributes.y;
    vec3 weights = vec3(u, v, 1.0 - u - v);
    vec3 mixed = vec3(0.0);
    for (int corner = 0; corner < 3; corner++) {
        mixed += weights[corner] * corners[3 * gl_PrimitiveID + corner].rgb;
    }
    colour = mixed;
}
