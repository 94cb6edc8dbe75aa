#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
//@ flags: -g

// Point splatting: the nearest point wins the pixel, by one atomic minimum of depth and colour.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) readonly buffer Points { float depth[]; };
layout(set = 0, binding = 2, std430) buffer Pixels { uint64_t nearest; };
layout(set = 0, binding = 2, std430) buffer Halves { uint color; uint nearest_depth; };

void main() {
    uint point = gl_GlobalInvocationID.x;
    uint64_t key = uint64_t(floatBitsToUint(depth[point])) << 32 | point;
    atomicMin(nearest, key);
    // The first point is always shown.
    if (point == 0u) {
        atomicAnd(nearest_depth, 0u);
        atomicExchange(color, 0u);
    }
}
