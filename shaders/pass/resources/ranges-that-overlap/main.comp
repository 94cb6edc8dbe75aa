#version 460

// The same, by workgroups of one batch each.
layout(local_size_x = 64) in;
layout(set = 0, binding = 3, std430) buffer Here { uint here[]; };
layout(set = 0, binding = 4, std430) buffer Next { uint next[]; };

void main() {
    uint at = gl_GlobalInvocationID.x;
    next[at] = here[at] + 1u;
}
