#version 460
//@ flags: -g

// Creases of a mesh: the angle between the normals of the two faces at each edge.

layout(local_size_x = 4) in;

struct EdgeNormals {
    vec4 left;
    vec4 right;
};

layout(set = 0, binding = 1, std430) writeonly buffer Creases { float creases[]; };
layout(set = 0, binding = 2, std430) readonly buffer Edges { EdgeNormals edges[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    EdgeNormals edge = edges[index];
    float angle = acos(clamp(dot(edge.left.xyz, edge.right.xyz), -1.0, 1.0));
    creases[index] = degrees(angle);
}
