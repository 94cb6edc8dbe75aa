#version 460
//@ flags: -g

// Variance-guided sampling: mean and mean square of each pixel's luminance, over all frames.

layout(local_size_x = 8) in;
layout(push_constant) uniform Frame { uint frame; };
layout(set = 0, binding = 1, std430) buffer Moments { vec2 moments[]; };
layout(set = 0, binding = 2, std430) readonly buffer Samples { float luminance[]; };

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    float value = luminance[pixel];
    vec2 sum = vec2(value, value * value);
    if (frame > 0u) {
        sum += moments[pixel] * float(frame);
    }
    moments[pixel] = sum / float(frame + 1u);
}
