#version 460
//@ flags: -g

// The coverage of a sprite, softened at its edges: the mean of the alphas to the left and right.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, rgba8) readonly uniform image2D sprite;
layout(set = 0, binding = 2, std430) writeonly buffer Coverage { float coverage[]; };

void main() {
    int x = int(gl_GlobalInvocationID.x);
    float left = imageLoad(sprite, ivec2(x - 1, 0)).a;
    float right = imageLoad(sprite, ivec2(x + 1, 0)).a;
    coverage[x] = 0.5 * (left + right);
}
