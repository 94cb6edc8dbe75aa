#version 460
#extension GL_EXT_buffer_reference : require

// What the launch has stored, through a range and through the device address of the buffer.
layout(local_size_x = 32) in;
layout(buffer_reference, std430) buffer Words { uint words[]; };
layout(push_constant) uniform Push { Words arena; };
layout(set = 0, binding = 2, std430) buffer Part { uint part[]; };
layout(set = 0, binding = 4, std430) buffer Sums { uint sums[]; };

void main() {
    uint at = gl_GlobalInvocationID.x;
    sums[at] = part[at] + arena.words[at];
    part[at] = 7u;
    sums[at] += arena.words[96 + at];
}
