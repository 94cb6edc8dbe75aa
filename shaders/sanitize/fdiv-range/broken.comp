#version 460
//@ flags: -g

// The size of a texel on the screen, by the distance at which a ray hits it.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Footprints { float footprints[]; };
layout(set = 0, binding = 2, std430) readonly buffer Distances { float distances[]; };

const float PIXELS_PER_UNIT = 1024.0;
const float FARTHEST = 1e6;

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    float depth = distances[pixel];
    footprints[pixel] = PIXELS_PER_UNIT / depth;
}
