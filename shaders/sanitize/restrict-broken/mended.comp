#version 460
//@ flags: -g

// Tone mapping of a frame, in place.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) restrict buffer Pixels { float pixels[]; };

float tone_mapped(float luminance) {
    return luminance / (1.0 + luminance);
}

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    float luminance = pixels[pixel];
    pixels[pixel] = tone_mapped(luminance);
}
