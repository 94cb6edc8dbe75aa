//@ also O0: -O0
#version 460
#extension GL_NV_shader_atomic_fp16_vector : require
#extension GL_EXT_shader_explicit_arithmetic_types_float16 : require

// Atomic functions on f16vec2 and f16vec4 in shared memory, a buffer and an image.

layout(local_size_x = 8) in;
layout(std430, binding = 1) buffer Outputs {
    f16vec2 before[8];
    f16vec2 sum;
    f16vec2 exchanged;
    f16vec4 greatest;
    f16vec4 least;
};
layout(rgba16f, binding = 2) uniform image2D picture;

shared f16vec2 shared_sum;

void main() {
    uint at = gl_LocalInvocationIndex;
    float16_t h = float16_t(at);
    if (at == 0) {
        shared_sum = f16vec2(0.0hf);
    }
    barrier();
    before[at] = atomicAdd(shared_sum, f16vec2(1.0hf, h));
    barrier();
    if (at == 0) {
        sum = shared_sum;
    }
    atomicExchange(exchanged, f16vec2(h, -h));
    atomicMax(greatest, f16vec4(h, -h, 1.0hf, 2.0hf));
    atomicMin(least, f16vec4(h, -h, 1.0hf, 2.0hf));
    imageAtomicAdd(picture, ivec2(0), f16vec4(1.0hf, 2.0hf, 3.0hf, h));
}
