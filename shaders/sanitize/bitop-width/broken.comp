#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
//@ flags: -g

// How many voxels of each brick of 4 x 4 x 4 are solid.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, std430) writeonly buffer Counts { uint counts[]; };
layout(set = 0, binding = 2, std430) readonly buffer Bricks { uint64_t bricks[]; };

void main() {
    uint64_t brick = bricks[gl_GlobalInvocationID.x];
    counts[gl_GlobalInvocationID.x] = uint(bitCount(brick));
}
