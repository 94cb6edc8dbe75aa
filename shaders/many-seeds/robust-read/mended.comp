#version 460
//@ flags: -g

// Blurs a row of pixels with the neighbours of each.

layout(local_size_x = 8) in;

layout(set = 0, binding = 1, std430) readonly buffer Row { float row[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Blurred { float blurred[]; };

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    uint last = uint(row.length()) - 1u;
    float left = row[max(pixel, 1u) - 1u];
    float right = row[min(pixel + 1u, last)];
    blurred[pixel] = 0.25 * left + 0.5 * row[pixel] + 0.25 * right;
}
