#version 460
//@ flags: -g

// Tone mapping of a frame, from one buffer to another.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) restrict readonly buffer Pixels { float pixels[]; };
layout(set = 0, binding = 2, std430) restrict buffer Filtered { float filtered[]; };

float tone_mapped(float luminance) {
    return luminance / (1.0 + luminance);
}

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    float luminance = pixels[pixel];
    filtered[pixel] = tone_mapped(luminance);
}
