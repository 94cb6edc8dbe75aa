#version 460
//@ flags: -gVS

// A workgroup whose invocations turn in a loop for as long as one likes, and wait for each other.

layout(local_size_x = 64) in;

layout(push_constant) uniform Constants { uint turns; };
layout(set = 0, binding = 0, std430) buffer Outputs { uint sums[4]; };
layout(set = 0, binding = 1, std430) buffer Counts { uint count; };

shared uint states[64];

uint next(uint state) {
    return state * 1664525u + 1013904223u;
}

void main() {
    uint own = gl_LocalInvocationIndex;
    uint seen[4];
    uint last;
    uint random = own;
    if (turns == 0u) {
        random = 0u;
    }
    for (uint turn = 0u; turn < turns; ++turn) {
        random = next(random);
        if ((turn & 1023u) == 1023u) {
            seen[turn >> 10 & 3u] = random;
            last = turn;
            atomicAdd(count, 1u);
        }
    }
    states[own] = random;
    barrier();
    if (own < 4u) {
        sums[own] = states[own] + states[63u - own];
    }
}
