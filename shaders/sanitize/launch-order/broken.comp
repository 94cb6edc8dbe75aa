#version 460
#extension GL_KHR_memory_scope_semantics : require
//@ flags: -g

// A prefix sum over workgroups, in one pass.

layout(local_size_x = 1) in;
layout(set = 0, binding = 1, std430) readonly buffer Values { uint values[]; };
layout(set = 0, binding = 2, std430) coherent buffer Sums { uint sums[]; };
layout(set = 0, binding = 3, std430) buffer Flags { uint is_ready[]; };

const int BUFFER = gl_StorageSemanticsBuffer;

void main() {
    uint group = gl_WorkGroupID.x;
    while (atomicLoad(is_ready[group], gl_ScopeDevice, BUFFER, gl_SemanticsAcquire) == 0u) {
    }
    uint before = group > 0u ? sums[group - 1u] : 0u;
    sums[group] = before + values[group];
    atomicStore(is_ready[group + 1u], 1u, gl_ScopeDevice, BUFFER, gl_SemanticsRelease);
}
