#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_nonuniform_qualifier : require
//@ flags: -g

// Leaves of several trees: the record of each has the number of its texture.

layout(set = 0, binding = 2) uniform sampler2D textures[2];
layout(shaderRecordEXT, std430) buffer Tree {
    uint albedo;
};
layout(location = 0) rayPayloadInEXT vec4 color;
hitAttributeEXT vec2 barycentrics;

void main() {
    color = textureLod(textures[albedo], barycentrics, 0.0);
}
