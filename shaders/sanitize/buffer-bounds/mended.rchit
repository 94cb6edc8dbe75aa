#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// The color of the material of a triangle.

struct Material {
    vec3 color;
    float roughness;
};

layout(set = 0, binding = 2, std430) readonly buffer Materials { Material materials[]; };
layout(set = 0, binding = 3, std430) readonly buffer Triangles { uint triangle_materials[]; };
layout(location = 0) rayPayloadInEXT vec3 color;

void main() {
    uint index = triangle_materials[gl_PrimitiveID];
    color = materials[index].color;
}
