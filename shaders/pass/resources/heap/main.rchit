#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_descriptor_heap : require
#extension GL_EXT_nonuniform_qualifier : require
#include "../model/model.glsl"

// Indices of the resource heap, in the order of the scene.
const uint VERTICES = 2;
const uint INDICES = 3;
const uint GEOMETRIES = 4;
const uint MATERIALS = 5;
const uint FIRST_TEXTURE = 64;
const uint SAMPLER = 3;

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

layout(descriptor_heap, std430) readonly buffer Vertices { Vertex all[]; } vertices[];
layout(descriptor_heap, std430) readonly buffer Indices { uint all[]; } indices[];
layout(descriptor_heap, std430) readonly buffer Geometries { Geometry all[]; } geometries[];
layout(descriptor_heap, std430) readonly buffer Materials { Material all[]; } materials[];
layout(descriptor_heap) uniform texture2D textures[];
layout(descriptor_heap) uniform sampler samplers[];

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT vec2 attributes;

void main() {
    Geometry geometry = geometries[GEOMETRIES].all[gl_InstanceCustomIndexEXT + gl_GeometryIndexEXT];
    Material material = materials[MATERIALS].all[geometry.material];
    uint first = geometry.first_index + 3 * gl_PrimitiveID;
    Vertex a = vertices[VERTICES].all[geometry.first_vertex + indices[INDICES].all[first]];
    Vertex b = vertices[VERTICES].all[geometry.first_vertex + indices[INDICES].all[first + 1]];
    Vertex c = vertices[VERTICES].all[geometry.first_vertex + indices[INDICES].all[first + 2]];
    vec2 uv = a.texcoord * (1.0 - attributes.x - attributes.y) + b.texcoord * attributes.x
        + c.texcoord * attributes.y;
    float m[6] = material.transform;
    vec2 at = vec2(m[0] * uv.x + m[1] * uv.y + m[2], m[3] * uv.x + m[4] * uv.y + m[5]);
    payload.colour = material.base_color.rgb;
    if (material.base_color_texture != 0xffffffffu) {
        uint index = FIRST_TEXTURE + material.base_color_texture;
        payload.colour *=
            textureLod(sampler2D(textures[nonuniformEXT(index)], samplers[SAMPLER]), at, 0.0).rgb;
    }
    payload.feature = a.feature;
}
