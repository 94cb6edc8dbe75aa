#version 460
#extension GL_EXT_buffer_reference : require
//@ flags: -g

// The tangents of a strand of hair at its points.

layout(local_size_x = 4) in;

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Points { vec4 at[]; };

struct Strand {
    Points points; // position and radius
    uint count;
};

layout(set = 0, binding = 1, std430) writeonly buffer Tangents { vec4 tangents[]; };
layout(set = 0, binding = 2, std430) readonly buffer Strands { Strand strands[]; };

void main() {
    uint index = gl_LocalInvocationIndex;
    Strand strand = strands[gl_WorkGroupID.x];
    uint start = min(index, strand.count - 2u);
    vec3 tangent = strand.points.at[start + 1u].xyz - strand.points.at[start].xyz;
    tangents[gl_WorkGroupID.x * 4u + index] = vec4(normalize(tangent), 0.0);
}
