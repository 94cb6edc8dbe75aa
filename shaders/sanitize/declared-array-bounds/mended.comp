#version 460
//@ flags: -g

// The error of the level of detail that each of eight objects is drawn with.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) readonly buffer Levels { float errors[4]; float reserved[4]; };
layout(set = 0, binding = 2, std430) writeonly buffer Chosen { float chosen[]; };

void main() {
    uint object = gl_GlobalInvocationID.x;
    float away = exp2(float(object) * 0.75);
    uint level = min(uint(log2(away)), 3u);
    chosen[object] = errors[level];
}
