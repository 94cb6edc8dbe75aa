#version 460
//@ flags: -g

// The mask of the triangles of a meshlet's first word of 32, of which only so many are there.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Visible { uint visible[]; };
layout(set = 0, binding = 2, std430) readonly buffer Meshlets { uvec2 meshlets[]; }; // triangles, culled

uint first_bits(uint count) {
    return count < 32u ? (1u << count) - 1u : 0xFFFFFFFFu;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    uvec2 meshlet = meshlets[index];
    uint there = first_bits(min(meshlet.x, 32u));
    visible[index] = there & ~meshlet.y;
}
