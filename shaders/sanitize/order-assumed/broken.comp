#version 460
#pragma use_vulkan_memory_model
#extension GL_KHR_memory_scope_semantics : require
//@ flags: -g

// The greatest luminance of eight pixels, by halving.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) nonprivate buffer Luminance { float luminance[]; };

void main() {
    uint pixel = gl_LocalInvocationIndex;
    for (uint half_count = 4u; half_count > 0u; half_count /= 2u) {
        if (pixel < half_count) {
            luminance[pixel] = max(luminance[pixel], luminance[pixel + half_count]);
        }
        controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer,
                       gl_SemanticsAcquireRelease);
    }
}
