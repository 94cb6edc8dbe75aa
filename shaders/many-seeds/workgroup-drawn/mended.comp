#version 460
//@ flags: -g

// The brightness of each tile of 8 pixels, added up by its first invocation.

layout(local_size_x = 8) in;

layout(set = 0, binding = 1, std430) readonly buffer Pixels { float pixels[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Tiles { float tiles[]; };

shared float brightness[8];

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    uint place = gl_LocalInvocationID.x;
    brightness[place] = 0.0;
    if (pixel < uint(pixels.length())) {
        brightness[place] = pixels[pixel];
    }
    barrier();
    if (place == 0u) {
        float sum = 0.0;
        for (uint i = 0u; i < 8u; i++) {
            sum += brightness[i];
        }
        tiles[gl_WorkGroupID.x] = sum;
    }
}
