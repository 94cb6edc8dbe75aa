//@ also O0: -O0
#version 460
#extension GL_NV_cooperative_vector : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_EXT_shader_explicit_arithmetic_types : require

// A network of two layers that computes the exclusive or of two bits, and sums for its training.

layout(local_size_x = 4) in;
layout(constant_id = 1) const uint HIDDEN = 4;
layout(binding = 1) buffer Outputs {
    float16_t outputs[];
};
layout(binding = 2) readonly buffer Weights {
    float16_t weights[];
};
layout(binding = 3) buffer Gradients {
    float gradients[];
};

const int HALF = gl_ComponentTypeFloat16NV;
const int ROWS = gl_CooperativeVectorMatrixLayoutRowMajorNV;
const int OPTIMAL = gl_CooperativeVectorMatrixLayoutInferencingOptimalNV;

void main() {
    uint at = gl_LocalInvocationIndex;
    coopvecNV<float16_t, 2> bits = coopvecNV<float16_t, 2>(float16_t(at & 1), float16_t(at >> 1));
    coopvecNV<float16_t, HIDDEN> hidden;
    coopVecMatMulAddNV(hidden, bits, HALF, weights, 0, HALF, weights, 16, HALF, HIDDEN, 2, ROWS, false, 8);
    hidden = max(hidden, coopvecNV<float16_t, HIDDEN>(float16_t(0)));
    coopvecNV<float16_t, 1> result;
    coopVecMatMulNV(result, hidden, HALF, weights, 24, HALF, 1, HIDDEN, OPTIMAL, false, 0);
    result *= float16_t(3);
    coopVecStoreNV(result, outputs, 2 * at);

    coopVecOuterProductAccumulateNV(hidden, bits, gradients, 0, 8, ROWS, gl_ComponentTypeFloat32NV);
    coopvecNV<float, HIDDEN> sums = coopvecNV<float, HIDDEN>(hidden);
    sums[0] += 0.5;
    coopVecReduceSumAccumulateNV(sums, gradients, 16);
}
