#version 460
//@ flags: -g

// Finds edges for a denoiser: where the depth differs from that of the neighbours.

layout(local_size_x = 4, local_size_y = 2) in;

layout(set = 0, binding = 1, r32f) readonly uniform image2D depths;
layout(set = 0, binding = 2, r32f) writeonly uniform image2D edges;

float depth_at(ivec2 pixel) {
    return imageLoad(depths, pixel).r;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    float left = depth_at(pixel - ivec2(1, 0));
    float right = depth_at(pixel + ivec2(1, 0));
    float difference = abs(right - left);
    imageStore(edges, pixel, vec4(step(1.0, difference)));
}
