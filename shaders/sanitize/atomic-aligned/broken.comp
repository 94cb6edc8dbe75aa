#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
//@ flags: -g

// Counts samples in bins, which have a key before their count.

layout(local_size_x = 8) in;

layout(buffer_reference, std430, buffer_reference_align = 4) buffer Counter { uint count; };

layout(set = 0, binding = 1, std430) readonly buffer Samples { uint samples[]; };
layout(set = 0, binding = 2, std430) readonly buffer Histogram { uvec2 bins; };

const uint BIN_SIZE = 6u;
const uint COUNT_OFFSET = 4u;

Counter counter(uint bin) {
    uint carry;
    uint low = uaddCarry(bins.x, bin * BIN_SIZE + COUNT_OFFSET, carry);
    return Counter(uvec2(low, bins.y + carry));
}

void main() {
    uint bin = samples[gl_GlobalInvocationID.x];
    atomicAdd(counter(bin).count, 1u);
}
