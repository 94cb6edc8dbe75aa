#version 460
#extension GL_NV_cooperative_vector : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_EXT_shader_explicit_arithmetic_types : require

// Three layers of 64 neurons, as cooperative vectors.

layout(local_size_x = 64) in;
layout(binding = 1) writeonly buffer Outputs {
    float16_t outputs[];
};
// The matrices of all layers, then their biases.
layout(binding = 2) readonly buffer Weights {
    float16_t weights[];
};
layout(binding = 3) readonly buffer Inputs {
    float16_t inputs[];
};

const int HALF = gl_ComponentTypeFloat16NV;
const int ROWS = gl_CooperativeVectorMatrixLayoutRowMajorNV;
const uint WIDTH = 64;
const uint MATRIX = WIDTH * WIDTH * 2;

#define Vector coopvecNV<float16_t, WIDTH>

Vector layer(Vector x, uint number) {
    Vector y;
    coopVecMatMulAddNV(y, x, HALF, weights, number * MATRIX, HALF, weights, 3 * MATRIX + number * WIDTH * 2, HALF,
        WIDTH, WIDTH, ROWS, false, WIDTH * 2);
    return max(y, Vector(float16_t(0)));
}

void main() {
    uint at = gl_GlobalInvocationID.x * WIDTH * 2;
    Vector x;
    coopVecLoadNV(x, inputs, at);
    x = layer(layer(layer(x, 0), 1), 2);
    coopVecStoreNV(x, outputs, at);
}
