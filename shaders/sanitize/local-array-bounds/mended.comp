#version 460
//@ flags: -g

// Counts the leaves below some nodes of a binary tree.

layout(local_size_x = 2) in;

struct Node {
    uint left; // 0 in a leaf
    uint right;
};

layout(set = 0, binding = 1, std430) writeonly buffer Counts { uint counts[]; };
layout(set = 0, binding = 2, std430) readonly buffer Tree { Node nodes[]; };
layout(set = 0, binding = 3, std430) readonly buffer Roots { uint roots[]; };

const uint STACK_SIZE = 16u;

void main() {
    uint stack[STACK_SIZE];
    uint size = 0u;
    uint leaves = 0u;
    stack[size++] = roots[gl_GlobalInvocationID.x];
    while (size > 0u) {
        Node node = nodes[stack[--size]];
        if (node.left == 0u) {
            ++leaves;
        } else {
            stack[size++] = node.left;
            stack[size++] = node.right;
        }
    }
    counts[gl_GlobalInvocationID.x] = leaves;
}
