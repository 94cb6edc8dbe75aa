#version 460
//@ flags: -g

// Weights of a reconstruction filter that the settings choose, at the offset of each sample.

layout(local_size_x = 6) in;
layout(set = 0, binding = 1, std430) writeonly buffer Weights { float weights[]; };
layout(set = 0, binding = 2, std430) readonly buffer Samples { vec2 samples[]; }; // kind, offset

const uint BOX = 0u;
const uint TENT = 1u;
const uint GAUSSIAN = 2u;

float weight(uint kind, float offset) {
    switch (kind) {
    case BOX:
        return abs(offset) <= 0.5 ? 1.0 : 0.0;
    case TENT:
        return max(1.0 - abs(offset), 0.0);
    case GAUSSIAN:
        return exp(-2.0 * offset * offset);
    }
    return 0.0;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec2 one = samples[index];
    weights[index] = weight(uint(one.x), one.y);
}
