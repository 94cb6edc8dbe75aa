#version 460
#extension GL_EXT_spirv_intrinsics : require
//@ flags: -g

// Sums of luminance: each invocation writes one, and then adds up a pair of them.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) spirv_decorate(20) coherent buffer Rows { float rows[]; };
layout(set = 0, binding = 2, std430) spirv_decorate(20) coherent buffer Pairs { vec2 pairs[]; };

void main() {
    uint row = gl_LocalInvocationIndex;
    rows[row] = float(row) * 0.25;
    memoryBarrierBuffer();
    barrier();
    float sum = 0.0;
    if (row < 4u) {
        sum = pairs[row].x + pairs[row].y;
    }
    memoryBarrierBuffer();
    barrier();
    if (row < 4u) {
        rows[row] = sum;
    }
}
