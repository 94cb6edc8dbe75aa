#version 460
//@ flags: -g

// How many texels the levels of a texture have.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, std430) writeonly buffer Texels { int texels[]; };
layout(set = 0, binding = 2) uniform sampler2D pyramid;

void main() {
    int level = int(gl_LocalInvocationIndex);
    bool has_level = level < textureQueryLevels(pyramid);
    ivec2 size = has_level ? textureSize(pyramid, level) : ivec2(0);
    texels[level] = size.x * size.y;
}
