#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
//@ flags: -g

// Moves the vertices of a mesh, which are packed.

layout(local_size_x = 4) in;

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Vertex {
    vec3 position;
    vec3 normal;
};

layout(set = 0, binding = 1, std430) writeonly buffer Moved { vec4 moved[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Mesh { uvec2 vertices; };

const uint VERTEX_SIZE = 24u;
const vec3 WIND = vec3(0.0, 0.0, 0.25);

Vertex vertex(uint index) {
    uint carry;
    uint low = uaddCarry(vertices.x, index * VERTEX_SIZE, carry);
    return Vertex(uvec2(low, vertices.y + carry));
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    moved[index] = vec4(vertex(index).position + WIND, 1.0);
}
