//@ flags: -g
#version 460

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, r32f) uniform readonly image2D seen;
layout(set = 0, binding = 3, std430) buffer Result { uint result[]; };

layout(push_constant, std430) uniform Constants { float exposure; float gain; };

void main() {
    uint x = gl_GlobalInvocationID.x;
    float lit = imageLoad(seen, ivec2(int(x), 0)).x;
    float exposed = lit * exposure;
    result[x] = uint(exposed * gain);
}
