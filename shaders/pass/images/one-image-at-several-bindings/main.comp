#version 460

// The image that the launch stored, as a sampled one; and through two bindings that are stored and
// loaded: each invocation loads the column that the invocation before it stores.
layout(local_size_x = 64) in;
layout(set = 0, binding = 3) uniform sampler2D sampled;
layout(set = 0, binding = 4, std430) buffer Outputs { vec4 outputs[]; };
layout(set = 0, binding = 5, r32ui) uniform uimage2D row;
layout(set = 0, binding = 6, r32ui) uniform uimage2D row_again;

void main() {
    int at = int(gl_GlobalInvocationID.x);
    if (at < 4) outputs[at] = texelFetch(sampled, ivec2(at, 1), 0);
    imageStore(row, ivec2(at + 1, 0), imageLoad(row_again, ivec2(at, 0)) + 1u);
}
