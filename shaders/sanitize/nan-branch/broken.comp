#version 460
//@ flags: -g

// Adaptive sampling: pixels whose relative error is large get more samples in the next pass.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Samples { uint samples[]; };
layout(set = 0, binding = 2, std430) readonly buffer Moments { vec2 moments[]; }; // mean, mean of squares

const float LARGEST_ERROR = 0.0625;

bool is_noisy(float mean, float variance) {
    return variance / (mean * mean) > LARGEST_ERROR;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec2 moment = moments[index];
    uint more = 1u;
    if (is_noisy(moment.x, moment.y - moment.x * moment.x)) {
        more = 16u;
    }
    samples[index] = more;
}
