#version 460
//@ flags: -g

// Upsamples shading at half resolution: an invocation has one sample, and writes the four pixels
// that it covers.

layout(local_size_x = 4, local_size_y = 4) in;
layout(set = 0, binding = 1, rgba32f) uniform writeonly image2D frame;
layout(set = 0, binding = 2, std430) readonly buffer Samples { vec4 samples[]; };

void main() {
    uvec2 at = gl_GlobalInvocationID.xy;
    vec4 color = samples[at.y * 4 + at.x];
    for (int pixel = 0; pixel < 4; ++pixel) {
        ivec2 offset = ivec2(pixel & 1, pixel >> 1);
        imageStore(frame, 2 * ivec2(at) + offset, color);
    }
}
