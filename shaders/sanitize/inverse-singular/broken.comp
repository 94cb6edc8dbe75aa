#version 460
//@ flags: -g

// Normals of instances: the inverse transpose of the matrix that places each.

layout(local_size_x = 2) in;
layout(set = 0, binding = 1, std430) writeonly buffer Normals { vec4 normals[]; };
layout(set = 0, binding = 2, std430) readonly buffer Instances { mat3x4 instances[]; };

mat3 cofactors(mat3 m) {
    return mat3(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1]));
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    mat3 placed = mat3(instances[index]);
    mat3 turned = transpose(inverse(placed));
    vec3 normal = turned * vec3(0.0, 1.0, 0.0);
    normals[index] = vec4(normalize(normal), 0.0);
}
