#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
//@ flags: -g

// Gathers the indices of triangles, of two words each.

layout(local_size_x = 8) in;
layout(buffer_reference, buffer_reference_align = 8, std430) readonly buffer Pair { uvec2 indices; };
layout(push_constant) uniform Constants { uint64_t address; uint count; };
layout(set = 0, binding = 1, std430) writeonly buffer Copied { uvec2 copied[]; };

void main() {
    uint pair = gl_GlobalInvocationID.x;
    copied[pair] = Pair(address + 8ul * pair).indices;
}
