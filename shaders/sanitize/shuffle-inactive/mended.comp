#version 460
#extension GL_KHR_shader_subgroup_shuffle : require
//@ flags: -g

// Two neighbours of a row share the nearer one of their depths. Depths are reversed: 1 is at the
// eye, and 0 is the sky, which keeps its own.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) writeonly buffer Nearest { float nearest[]; };
layout(set = 0, binding = 2, std430) readonly buffer Depths { float depths[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    float depth = depths[index];
    float result = 0.0;
    float neighbour = subgroupShuffleXor(depth, 1u);
    if (depth > 0.0) {
        result = max(depth, neighbour);
    }
    nearest[index] = result;
}
