#version 460
//@ flags: -g

// Fog over an image: depths are infinite where no surface was hit.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, std430) writeonly buffer Fog { float fog[]; };
layout(set = 0, binding = 2, std430) readonly buffer Depths { float depths[]; };

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    float depth = depths[pixel];
    if (isinf(depth)) {
        fog[pixel] = 1.0;
    } else {
        fog[pixel] = 1.0 - exp(-0.125 * depth);
    }
}
