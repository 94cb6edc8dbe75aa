//@ also O0: -O0
#version 460
#extension GL_KHR_cooperative_matrix : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_EXT_shader_explicit_arithmetic_types : require

// The product of a triangular matrix in shared memory with a matrix in a buffer.

layout(local_size_x = 32) in;
layout(constant_id = 1) const uint SIZE = 16;
layout(binding = 1) buffer Outputs {
    float outputs[];
};
layout(binding = 2) readonly buffer Inputs {
    float16_t inputs[];
};

shared float16_t triangle[64];

void main() {
    for (uint at = gl_LocalInvocationIndex; at < 64; at += 32) {
        triangle[at] = float16_t(at % 8 <= at / 8 ? 1 : 0);
    }
    controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsShared,
        gl_SemanticsAcquireRelease | gl_SemanticsMakeAvailable | gl_SemanticsMakeVisible);
    coopmat<float16_t, gl_ScopeSubgroup, SIZE, SIZE, gl_MatrixUseA> a;
    coopmat<float16_t, gl_ScopeSubgroup, SIZE, SIZE, gl_MatrixUseB> b;
    coopmat<float, gl_ScopeSubgroup, SIZE, SIZE, gl_MatrixUseAccumulator> c =
        coopmat<float, gl_ScopeSubgroup, SIZE, SIZE, gl_MatrixUseAccumulator>(3.0);
    coopMatLoad(a, triangle, 0, 8, gl_CooperativeMatrixLayoutRowMajor);
    coopMatLoad(b, inputs, 0, 8, gl_CooperativeMatrixLayoutColumnMajor);
    c = coopMatMulAdd(a, b, c);
    for (int at = 0; at < c.length(); at++) {
        c[at] = c[at] * 0.5 + 1.0;
    }
    coopMatStore(c * 2.0, outputs, 0, 8, gl_CooperativeMatrixLayoutRowMajor);
}
