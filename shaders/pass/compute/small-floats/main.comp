//@ also O0: -O0
#version 460
#extension GL_EXT_bfloat16 : require
#extension GL_EXT_float_e4m3 : require
#extension GL_EXT_float_e5m2 : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_scalar_block_layout : require

// bfloat16 and the floats of eight bits through glslang: constants, conversions that saturate and others,
// vectors, buffers, shared memory.

layout(local_size_x = 4) in;
layout(constant_id = 1) const bfloat16_t scale = bfloat16_t(2.5);
layout(scalar, binding = 1) buffer Outputs {
    vec4 outputs[12];
};
layout(scalar, binding = 2) readonly buffer Inputs {
    double values[4];
    bf16vec3 vectors[2];
    fe4m3vec4 e4m3;
    fe5m2vec2 e5m2;
};

shared bfloat16_t multiples[4];

void main() {
    uint at = gl_LocalInvocationIndex;
    double value = values[at];
    floate4m3_t greatest4;
    floate5m2_t greatest5;
    saturatedConvertEXT(greatest4, value);
    saturatedConvertEXT(greatest5, value);
    multiples[at] = bfloat16_t(int(at) * 257);
    barrier();
    outputs[3 * at] = vec4(float(bfloat16_t(value)), float(floate4m3_t(value)), float(floate5m2_t(value)), float(greatest4));
    outputs[3 * at + 1] = vec4(float(greatest5), float(int(bfloat16_t(value))), float(floate5m2_t(at * 1000000u)),
        float(float16_t(e4m3[at])));
    bfloat16_t product = dot(vectors[at & 1], bf16vec3(scale, bfloat16_t(1.0), bfloat16_t(2.0)));
    outputs[3 * at + 2] = vec4(float(product), float(e4m3[at]), float(floate5m2BitsToUintEXT(e5m2[at & 1])),
        float(multiples[(at + 1) & 3]));
}
