#version 460
#extension GL_KHR_shader_subgroup_basic : require
//@ flags: -g

// The sum of the luminance of eight pixels, by halving within a subgroup.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) readonly buffer Luminance { float luminance[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Sums { float sums[]; };

shared float partial[8];

void main() {
    uint lane = gl_SubgroupInvocationID;
    partial[lane] = luminance[lane];
    subgroupBarrier();
    for (uint half_count = 4u; half_count > 0u; half_count /= 2u) {
        if (lane < half_count) {
            partial[lane] += partial[lane + half_count];
        }
        subgroupBarrier();
    }
    if (lane == 0u) {
        sums[0] = partial[0];
    }
}
