#version 460
//@ flags: -g

// The slope of a row of pixels, to find edges.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) readonly buffer Pixels { float pixels[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Slopes { float slopes[]; };

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    uint next = pixel + 1u;
    slopes[pixel] = pixels[next] - pixels[pixel];
}
