#version 460
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_EXT_shader_16bit_storage : require
#extension GL_EXT_shader_8bit_storage : require
#extension GL_EXT_scalar_block_layout : require

// Blocks with members of every scalar type, matrices of both orders and nested arrays.

layout(local_size_x = 1) in;

struct Inner {
    vec3 a;
    float b;
    uint c;
};

layout(set = 0, binding = 0, std430) buffer Block {
    uint u;
    int i;
    float f;
    uint pad;
    vec3 v3;
    float16_t h;
    double d;
    int64_t i64;
    uint64_t u64;
    mat3 m3;
    layout(row_major) mat2x3 rm;
    mat2x3 cm;
    mat3x2 m32;
    uint8_t u8;
    int16_t i16;
    Inner inner[2];
    float arr[6];
    bvec2 bb;
    bool flag;
    Inner tail[];
} b;

layout(set = 0, binding = 1, std430) buffer Vectors {
    vec3 v[];
} vectors;

layout(set = 0, binding = 2, std140) uniform Uniforms {
    float x[4];
    mat2 m;
} uniforms;

layout(set = 0, binding = 3, std430) buffer Outputs {
    uint o[16];
} outputs;

layout(push_constant) uniform Constants {
    uint count;
    float scale;
    ivec2 off;
} constants;

layout(constant_id = 3) const uint SC = 5;
layout(constant_id = 4) const float SF = 0.5;
layout(constant_id = 5) const bool SB = true;

void main() {
    outputs.o[0] = b.u;
    outputs.o[1] = uint(b.i);
    outputs.o[2] = floatBitsToUint(b.f);
    outputs.o[3] = uint(vectors.v.length());
    outputs.o[4] = floatBitsToUint(vectors.v[1].x);
    outputs.o[5] = floatBitsToUint(uniforms.x[1]);
    outputs.o[6] = constants.count;
    outputs.o[7] = floatBitsToUint(constants.scale);
    outputs.o[8] = SC;
    outputs.o[9] = floatBitsToUint(SF);
    outputs.o[10] = uint(SB);
    outputs.o[11] = uint(b.flag);
    outputs.o[12] = uint(b.tail.length());
    outputs.o[13] = floatBitsToUint(b.m32[2].y);
    outputs.o[14] = floatBitsToUint(b.rm[1].x);
    b.f = b.f + 1.0;
}
