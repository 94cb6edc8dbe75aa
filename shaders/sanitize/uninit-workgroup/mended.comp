#version 460
//@ flags: -g

// The mean luminance of a frame, from which the next one's exposure follows: a workgroup sums up
// 64 pixels in shared memory.

layout(local_size_x = 64) in;
layout(set = 0, binding = 1, std430) writeonly buffer Sums { float sums[]; };
layout(set = 0, binding = 2, std430) readonly buffer Frame { vec4 pixels[]; };

shared float luminance[64];

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    uint lane = gl_LocalInvocationIndex;
    luminance[lane] = 0.0;
    if (pixel < pixels.length()) {
        luminance[lane] = dot(pixels[pixel].rgb, vec3(0.2126, 0.7152, 0.0722));
    }
    barrier();
    for (uint half_count = 32; half_count > 0; half_count /= 2) {
        if (lane < half_count) {
            luminance[lane] += luminance[lane + half_count];
        }
        barrier();
    }
    if (lane == 0) {
        sums[gl_WorkGroupID.x] = luminance[0];
    }
}
