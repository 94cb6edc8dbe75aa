#version 460
#extension GL_EXT_spirv_intrinsics : require
//@ flags: -g

// Roulette: the throughput of a path is divided by the chance that it survives, which is never 0.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Weights { float weights[]; };
layout(set = 0, binding = 2, std430) readonly buffer Paths { float throughputs[]; };

spirv_instruction(extensions = ["SPV_KHR_expect_assume"], capabilities = [5629], id = 5630)
void assumeTrue(bool condition);

void main() {
    uint index = gl_GlobalInvocationID.x;
    float throughput = throughputs[index];
    float chance = clamp(throughput, 0.05, 0.95);
    assumeTrue(chance > 0.0);
    weights[index] = chance > 0.0 ? throughput / chance : 0.0;
}
