#version 460
#extension GL_KHR_memory_scope_semantics : require
//@ flags: -g

// Counts the pixels that are too bright, as a hint for the exposure.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) buffer Count { uint bright; };
layout(set = 0, binding = 2, std430) readonly buffer Frame { float radiance[]; };

void main() {
    if (radiance[gl_GlobalInvocationID.x] > 1.0) {
        atomicAdd(bright, 1u, gl_ScopeDevice, 0, 0);
    }
}
