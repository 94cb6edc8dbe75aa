#version 460
//@ flags: -g

// A histogram of luminance for automatic exposure, of the pixels of a workgroup in shared memory
// first.

layout(local_size_x = 16) in;
layout(set = 0, binding = 1, std430) buffer Histogram { uint histogram[16]; };
layout(set = 0, binding = 2, std430) readonly buffer Frame { float luminance[]; };

shared uint bins[16];

void main() {
    uint lane = gl_LocalInvocationIndex;
    bins[lane] = 0;
    barrier();
    float stops = log2(max(luminance[gl_GlobalInvocationID.x], 1.0 / 256.0)) + 8.0;
    atomicAdd(bins[min(uint(stops), 15)], 1);
    barrier();
    atomicAdd(histogram[lane], bins[lane]);
}
