#version 460
//@ flags: -g

// Jitter in double precision for deep zooms, from two random words a pixel.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Jitters { double jitters[]; };
layout(set = 0, binding = 2, std430) readonly buffer Random { uvec2 random[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    uvec2 bits = random[index];
    double jitter = packDouble2x32(bits);
    jitters[index] = jitter - 1.0lf;
}
