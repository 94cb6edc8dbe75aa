#version 460
//@ flags: -g

// Both bindings are of one buffer, the second from its second number on: the sum that loses its
// digits is stored through one and loaded through the other.

layout(set = 0, binding = 1, std430) buffer Here { float here[]; };
layout(set = 0, binding = 2, std430) buffer There { float there[]; };

void main() {
    here[1] = here[0] + 0.5;
    here[2] = there[0] - here[0];
}
