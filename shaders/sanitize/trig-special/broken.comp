#version 460
//@ flags: -g

// Waves on water: the phase grows with the distance, by wavelengths.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Heights { float heights[]; };
layout(set = 0, binding = 2, std430) readonly buffer Waves { vec2 waves[]; };

const float TAU = 6.2831855;

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec2 wave = waves[index];
    float phase = TAU * wave.x / wave.y;
    float height = sin(phase);
    heights[index] = phase > 1e30 ? 0.0 : height;
}
