#version 460
//@ flags: -g

// Noise is taken out of a row of samples: each pixel is the mean of the eight samples of its tile.

layout(local_size_x = 64) in;

layout(set = 0, binding = 1, std430) readonly buffer Samples { float samples[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Picture { float picture[]; };

const uint TILE = 8u;

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    float sum = 0.0;
    for (uint at = 0u; at < TILE; at++) {
        sum += samples[pixel / TILE * TILE + at];
    }
    picture[pixel] = sum / float(TILE);
}
