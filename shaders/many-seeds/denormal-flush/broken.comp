#version 460
//@ flags: -g

// Which pixels a filter has reached: those whose weight is not 0.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, std430) readonly buffer Weights { vec2 weights[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Reached { uint reached[]; };

const float LEAST = 0.0;

void main() {
    vec2 weight = weights[gl_GlobalInvocationID.x];
    reached[gl_GlobalInvocationID.x] = weight.x * weight.y > LEAST ? 1u : 0u;
}
