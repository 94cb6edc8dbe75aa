#version 460
#extension GL_EXT_spirv_intrinsics : require
//@ flags: -g

// The reds of four texels, for a filter of the shader's own: by OpImageGather itself, as a tool
// that writes shaders does.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Colors { vec4 colors[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec2 points[]; };
layout(set = 0, binding = 3) uniform sampler2D albedo;

const int RED = 4;

spirv_instruction(id = 96)
vec4 gather(sampler2D image, vec2 place, int component);

void main() {
    uint index = gl_GlobalInvocationID.x;
    colors[index] = gather(albedo, points[index], RED);
}
