#version 460
//@ flags: -g

// Exposure: the average of the luminance of a tile.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) readonly buffer Luminance { float luminance[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Exposure { float average[]; };

shared float sums[8];

void main() {
    uint self = gl_LocalInvocationIndex;
    sums[self] = luminance[gl_GlobalInvocationID.x];
    for (uint stride = 4; stride > 0; stride /= 2) {
        barrier();
        if (self < stride) {
            sums[self] += sums[self + stride];
        }
    }
    average[gl_GlobalInvocationID.x] = sums[0] / 8.0;
}
