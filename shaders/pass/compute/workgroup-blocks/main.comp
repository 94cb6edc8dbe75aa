#version 460
#extension GL_EXT_shared_memory_block : require
#extension GL_EXT_shader_explicit_arithmetic_types : require

// Blocks in workgroup memory lie on each other (SPV_KHR_workgroup_memory_explicit_layout): bytes are
// written, words are read.
layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) buffer Outputs { uint outputs[4]; };
shared Bytes { uint8_t bytes[16]; };
shared Words { uint words[4]; };

void main() {
    uint i = gl_LocalInvocationIndex;
    for (uint k = 0; k < 4; k++) {
        bytes[4 * i + k] = uint8_t(16 * i + k);
    }
    barrier();
    outputs[i] = words[3 - i];
}
