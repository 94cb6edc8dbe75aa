#version 460

// Accesses outside buffers and images, with the results of robustBufferAccess2 and robustImageAccess2.
layout(local_size_x = 1) in;
layout(set = 0, binding = 1, std430) buffer Outputs {
    uvec4 partly;
    uvec4 beyond;
    vec4 rgba;
    vec4 red;
    uint returned[2];
};
layout(set = 0, binding = 2, std430) buffer Inputs { uvec4 inputs[]; };
layout(set = 0, binding = 3, rgba8) uniform image2D colours;
layout(set = 0, binding = 4, r32f) uniform image2D reds;
layout(set = 0, binding = 5, r32ui) uniform uimage2D counts;
layout(push_constant) uniform Constants { int one; };

void main() {
    partly = inputs[one];
    beyond = inputs[one + 1];
    inputs[one] = uvec4(7, 8, 9, 10);
    inputs[one + 2] = uvec4(11);
    returned[0] = atomicAdd(inputs[one + 1].x, 5u);
    rgba = imageLoad(colours, ivec2(one + 1, 0));
    red = imageLoad(reds, ivec2(-one, 0));
    imageStore(reds, ivec2(0, one + 1), vec4(9));
    returned[1] = imageAtomicAdd(counts, ivec2(0, -one), 3u);
}
