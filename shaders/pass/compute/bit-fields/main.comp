#version 460
//@ flags: -g

// Packs two halves into a word: what it begins as does not matter.

layout(local_size_x = 4) in;
layout(set = 0, binding = 0, std430) writeonly buffer Words { uint words[]; };

void main() {
    uint word;
    word = bitfieldInsert(word, gl_LocalInvocationIndex + 7u, 0, 16);
    word = bitfieldInsert(word, gl_LocalInvocationIndex, 16, 16);
    words[gl_LocalInvocationIndex] = word;
}
