#version 460
#extension GL_GOOGLE_include_directive : require
#include "model.glsl"

struct Vertex {
    vec2 texcoord;
    uint feature;
    uint unused;
};

struct Geometry {
    uint first_vertex;
    uint first_index;
    uint material;
};

struct Material {
    vec4 base_color;
    float transform[6]; // two rows, for (u, v, 1)
    uint base_color_texture;
    uint unused;
};

layout(set = 0, binding = 2, std430) readonly buffer Vertices { Vertex vertices[]; };
layout(set = 0, binding = 3, std430) readonly buffer Indices { uint indices[]; };
layout(set = 0, binding = 4, std430) readonly buffer Geometries { Geometry geometries[]; };
layout(set = 0, binding = 5, std430) readonly buffer Materials { Material materials[]; };
layout(set = 0, binding = 6) uniform sampler2D base_color;

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT vec2 attributes;

void main() {
    Geometry geometry = geometries[gl_InstanceCustomIndexEXT + gl_GeometryIndexEXT];
    Material material = materials[geometry.material];
    uint first = geometry.first_index + 3 * gl_PrimitiveID;
    Vertex a = vertices[geometry.first_vertex + indices[first]];
    Vertex b = vertices[geometry.first_vertex + indices[first + 1]];
    Vertex c = vertices[geometry.first_vertex + indices[first + 2]];
    vec2 uv = a.texcoord * (1.0 - attributes.x - attributes.y) + b.texcoord * attributes.x
        + c.texcoord * attributes.y;
    float m[6] = material.transform;
    vec2 at = vec2(m[0] * uv.x + m[1] * uv.y + m[2], m[3] * uv.x + m[4] * uv.y + m[5]);
    payload.colour = material.base_color.rgb;
    if (material.base_color_texture != 0xffffffffu) {
        payload.colour *= textureLod(base_color, at, 0.0).rgb;
    }
    payload.feature = a.feature;
}
