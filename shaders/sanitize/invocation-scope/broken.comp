#version 460
#extension GL_KHR_memory_scope_semantics : require
//@ flags: -g

// Hands the radiance of probes to the pass that blends them, with a flag for each probe.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, std430) buffer Probes { vec4 radiance[]; };
layout(set = 0, binding = 2, std430) buffer Flags { uint is_ready[]; };
layout(set = 0, binding = 3, std430) readonly buffer Rays { vec4 rays[]; };

void main() {
    uint probe = gl_GlobalInvocationID.x;
    radiance[probe] = 0.5 * (rays[2u * probe] + rays[2u * probe + 1u]);
    memoryBarrier(gl_ScopeInvocation, gl_StorageSemanticsBuffer, gl_SemanticsRelease);
    atomicStore(is_ready[probe], 1u, gl_ScopeDevice, 0, 0);
}
