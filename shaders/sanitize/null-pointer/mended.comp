#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
//@ flags: -g

// The color of one vertex of each mesh. Not all meshes have colors.

layout(local_size_x = 2) in;

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Colors { vec4 at[]; };

struct Mesh {
    Colors colors;
    uint vertex;
};

layout(set = 0, binding = 1, std430) writeonly buffer Results { vec4 results[]; };
layout(set = 0, binding = 2, std430) readonly buffer Meshes { Mesh meshes[]; };

const vec4 WHITE = vec4(1.0);

vec4 vertex_color(Mesh mesh) {
    if (uvec2(mesh.colors) == uvec2(0u)) {
        return WHITE;
    }
    return mesh.colors.at[mesh.vertex];
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    results[index] = vertex_color(meshes[index]);
}
