#version 460
//@ flags: -g

layout(local_size_x = 4) in;
layout(set = 1, binding = 3, rgba32f) uniform image2DArray pictures[2];

void main() {
    int at = int(gl_GlobalInvocationID.x);
    imageStore(pictures[1], ivec3(at * 3, 1, 0), vec4(at));
}
