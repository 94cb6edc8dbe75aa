#version 460
//@ flags: -gVS

layout(local_size_x = 1) in;

layout(push_constant) uniform Constants { uint turns; };
layout(set = 0, binding = 0, std430) buffer Outputs { uint state; };

// A linear congruential generator that runs for as long as one likes.
void main() {
    uint random = 1u;
    for (uint turn = 0u; turn < turns; ++turn) {
        random = random * 1664525u + 1013904223u;
    }
    state = random;
}
