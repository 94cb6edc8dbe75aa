#version 460
//@ flags: -g

// The brightest pixel of each block of eight.

layout(local_size_x = 8) in;

layout(set = 0, binding = 1, std430) writeonly buffer Brightest { float brightest[]; };
layout(set = 0, binding = 2, std430) readonly buffer Pixels { float pixels[]; };

shared float values[8];

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint pixel = gl_GlobalInvocationID.x;
    values[lane] = pixel < pixels.length() ? pixels[pixel] : 0.0;
    barrier();
    if (lane == 0u) {
        float most = 0.0;
        for (uint i = 0u; i < 8u; ++i) {
            most = max(most, values[i]);
        }
        brightest[gl_WorkGroupID.x] = most;
    }
}
