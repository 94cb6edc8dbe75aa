#version 460
//@ flags: -g

// Adds up the samples of a pixel, one of which is very bright.

layout(local_size_x = 2) in;

layout(set = 0, binding = 1, std430) readonly buffer Samples { vec3 samples[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Pixels { float pixels[]; };

void main() {
    vec3 one = samples[gl_GlobalInvocationID.x];
    precise float sum = one.x + one.y + one.z;
    pixels[gl_GlobalInvocationID.x] = sum;
}
