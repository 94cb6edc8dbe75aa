#version 460
#extension GL_EXT_nonuniform_qualifier : require
//@ flags: -g

// The colors of materials at one place, while their textures are being loaded.

layout(local_size_x = 3) in;

struct Material {
    vec3 color;
    uint texture_index;
};

layout(set = 0, binding = 1, std430) writeonly buffer Colors { vec4 colors[]; };
layout(set = 0, binding = 2, std430) readonly buffer Materials { Material materials[]; };
layout(set = 0, binding = 3, std430) readonly buffer Loaded { uint is_loaded[]; };
layout(set = 0, binding = 4) uniform sampler2D textures[];

const vec2 PLACE = vec2(0.5);

void main() {
    Material material = materials[gl_GlobalInvocationID.x];
    uint index = material.texture_index;
    vec3 color = material.color;
    color *= textureLod(textures[nonuniformEXT(index)], PLACE, 0.0).rgb;
    colors[gl_GlobalInvocationID.x] = vec4(color, 1.0);
}
