#version 460
#extension GL_EXT_spirv_intrinsics : require
//@ flags: -g

// Light that goes through a surface. What is expected is laid out for speed.

layout(local_size_x = 16) in;
layout(set = 0, binding = 1, std430) writeonly buffer Transmitted { float transmitted[]; };
layout(set = 0, binding = 2, std430) readonly buffer Alphas { float alphas[]; };

spirv_instruction(extensions = ["SPV_KHR_expect_assume"], capabilities = [5629], id = 5631)
bool expect(bool value, bool expected);

void main() {
    uint index = gl_GlobalInvocationID.x;
    bool is_opaque = alphas[index] >= 1.0;
    float light = 0.0;
    if (!expect(is_opaque, false)) {
        light = 1.0 - alphas[index];
    }
    transmitted[index] = light;
}
