#version 460
#extension GL_EXT_abort : require

layout(local_size_x = 4) in;

layout(set = 0, binding = 1) writeonly buffer Deviations { float deviations[]; };
layout(set = 0, binding = 2) readonly buffer Variances { float variances[]; };

void main() {
    uint at = gl_GlobalInvocationID.x;
    if (variances[at] < 0.0) {
        abortEXT("the variance of sample %u is negative: %f", at, variances[at]);
    }
    deviations[at] = sqrt(variances[at]);
}
