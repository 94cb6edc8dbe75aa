#version 460
//@ flags: -g

// How often a line meets a circle: by the sign of the discriminant, 0 being a line that touches it.

layout(local_size_x = 8) in;

struct Equation {
    float a;
    float b;
    float c;
};
layout(set = 0, binding = 1, std430) readonly buffer Equations { Equation equations[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Counts { uint counts[]; };

void main() {
    Equation one = equations[gl_GlobalInvocationID.x];
    float discriminant = one.b * one.b - one.a * one.c;
    counts[gl_GlobalInvocationID.x] = discriminant < 0.0 ? 0u : discriminant > 0.0 ? 2u : 1u;
}
