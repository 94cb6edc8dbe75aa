#version 460
//@ flags: -g

// The mean logarithm of the luminance of each row of four pixels, for automatic exposure.

layout(local_size_x = 3) in;
layout(set = 0, binding = 1, std430) writeonly buffer Exposures { float exposures[]; };
layout(set = 0, binding = 2, std430) readonly buffer Pixels { vec4 pixels[]; };

const uint WIDTH = 4u;

float luminance(vec3 color) {
    return dot(color, vec3(0.2126, 0.7152, 0.0722));
}

void main() {
    uint row = gl_GlobalInvocationID.x;
    float sum = 0.0;
    for (uint x = 0u; x < WIDTH; ++x) {
        sum += log(luminance(pixels[row * WIDTH + x].rgb));
    }
    exposures[row] = 0.18 / exp(sum / float(WIDTH));
}
