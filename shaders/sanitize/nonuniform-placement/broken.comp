#version 460
#extension GL_EXT_nonuniform_qualifier : require
//@ flags: -g

// The albedo of each hit, from the texture of its material.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Albedos { vec4 albedos[]; };
layout(set = 0, binding = 2, std430) readonly buffer Hits { uint materials[]; };
layout(set = 0, binding = 3) uniform sampler2D textures[3];

vec4 albedo(uint material) {
    return textureLod(textures[material], vec2(0.5), 0.0);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    albedos[index] = albedo(nonuniformEXT(materials[index]));
}
