#version 460
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
//@ flags: -g

// Paths that are alive are packed at the front of a queue: one lane of each subgroup reserves the
// places of all.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) buffer Queue { uint count; uint paths[]; };
layout(set = 0, binding = 2, std430) readonly buffer Throughputs { float throughputs[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (throughputs[index] > 0.01) {
        uint rank = subgroupExclusiveAdd(1u);
        uint alive = subgroupAdd(1u);
        uint first = 0u;
        if (subgroupElect()) {
            first = atomicAdd(count, alive);
        }
        first = subgroupBroadcastFirst(first);
        paths[first + rank] = index;
    }
}
