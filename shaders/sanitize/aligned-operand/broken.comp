#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
//@ flags: -g

// The keys of a sort of rays: the octant of the direction above the Morton code of the origin.

layout(local_size_x = 4) in;

layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer Keys {
    uint64_t keys[];
};
layout(set = 0, binding = 1, std430) readonly buffer Rays { uvec2 rays[]; };
layout(push_constant) uniform Sort { Keys sorted; };

void main() {
    uint ray = gl_GlobalInvocationID.x;
    sorted.keys[ray] = (uint64_t(rays[ray].y) << 32) | uint64_t(rays[ray].x);
}
