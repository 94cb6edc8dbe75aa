#version 460
//@ flags: -g

// Jitter of the samples of a pixel: a random number generator whose state is global (PCG).

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Jitter { vec2 jitter[]; };
layout(set = 0, binding = 2, std430) readonly buffer Frames { uint frames[]; }; // of each tile

uint state = 1u;

uint next() {
    state = state * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28) + 4u)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}

float next_float() {
    return float(next() >> 8) / 16777216.0;
}

void main() {
    uint tile = gl_GlobalInvocationID.x;
    if (frames[tile] > 0u) {
        state = tile * 1973u + frames[tile] * 9277u;
    }
    float x = next_float();
    jitter[tile] = vec2(x, next_float()) - 0.5;
}
