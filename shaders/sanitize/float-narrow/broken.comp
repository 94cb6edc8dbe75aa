#version 460
//@ flags: -g

// The radiance cache keeps two halves a word.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Cache { uint cache[]; };
layout(set = 0, binding = 2, std430) readonly buffer Radiances { vec2 radiances[]; };

const float MOST = 65504.0;

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec2 radiance = radiances[index];
    cache[index] = packHalf2x16(radiance);
}
