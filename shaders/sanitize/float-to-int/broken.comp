#version 460
//@ flags: -g

// The histogram of an exposure meter: 16 stops in 256 buckets.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) buffer Histogram { uint histogram[]; };
layout(set = 0, binding = 2, std430) readonly buffer Pixels { vec4 pixels[]; };

const float LEAST_STOP = -10.0;
const float STOPS = 16.0;
const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

uint bucket_of(float luminance) {
    float stop = log2(max(luminance, 1e-6)) - LEAST_STOP;
    return min(uint(stop * (256.0 / STOPS)), 255u);
}

void main() {
    vec3 color = pixels[gl_GlobalInvocationID.x].rgb;
    atomicAdd(histogram[bucket_of(dot(color, LUMINANCE))], 1u);
}
