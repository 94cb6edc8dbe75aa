#version 460
//@ flags: -g

// A field of signed distances: which cells are inside and which outside.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Sides { uint sides[]; };
layout(set = 0, binding = 2, std430) readonly buffer Field { float distances[]; };

const float FARTHEST = 1e6;

void main() {
    uint cell = gl_GlobalInvocationID.x;
    float signed_distance = distances[cell];
    float side = 1.0;
    if (abs(signed_distance) <= FARTHEST) {
        side = sign(signed_distance);
    }
    sides[cell] = side < 0.0 ? 1u : 0u;
}
