#version 460

layout(local_size_x = 4) in;

layout(set = 0, binding = 1) writeonly buffer Deviations { float deviations[]; };
layout(set = 0, binding = 2) readonly buffer Variances { float variances[]; };

void main() {
    uint at = gl_GlobalInvocationID.x;
    deviations[at] = sqrt(max(variances[at], 0.0));
}
