#version 460
//@ flags: -g

// Picks one of the lights for each pixel.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) readonly buffer Lights { uint seed; float powers[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Picked { uint picked[]; };

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    uint random = (pixel * 1664525u + seed) >> 8;
    if (powers.length() == 0) {
        picked[pixel] = ~0u;
        return;
    }
    picked[pixel] = min(random, uint(powers.length()) - 1u);
}
