#version 460
//@ flags: -g

// How many levels of detail textures have, by their size.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, std430) readonly buffer Sizes { uint sizes[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Levels { int levels[]; };

void main() {
    uint size = sizes[gl_GlobalInvocationID.x];
    levels[gl_GlobalInvocationID.x] = int(floor(log2(float(size)))) + 1;
}
