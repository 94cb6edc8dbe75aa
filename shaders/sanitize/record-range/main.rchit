#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// A surface of one color, which its record has.

layout(shaderRecordEXT, std430) readonly buffer Material {
    vec3 albedo;
    float roughness;
};

layout(location = 0) rayPayloadInEXT vec3 color;

void main() {
    color = albedo;
}
