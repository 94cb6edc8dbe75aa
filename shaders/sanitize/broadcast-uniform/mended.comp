#version 460
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
//@ flags: -g

// Four rays of a pixel share the light that the first of them has drawn.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) writeonly buffer Shared { uint lights[]; };
layout(set = 0, binding = 2, std430) readonly buffer Drawn { uint drawn[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint first = gl_SubgroupInvocationID & ~3u;
    lights[index] = subgroupShuffle(drawn[index], first);
}
