#version 460
//@ flags: -g

// Vertex indices of 10 bits each, packed one behind the other without gaps.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) writeonly buffer Indices { uint indices[]; };
layout(set = 0, binding = 2, std430) readonly buffer Packed { uint words[]; };

const int BITS = 10;

uint unpack(uint entry) {
    uint bit = entry * uint(BITS);
    uint word = bit / 32u;
    int offset = int(bit & 31u);
    return bitfieldExtract(words[word], offset, BITS);
}

void main() {
    uint entry = gl_GlobalInvocationID.x;
    indices[entry] = unpack(entry);
}
