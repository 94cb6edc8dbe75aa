#version 460
//@ flags: -g

// Distances of a scene that two cameras have seen, by how far apart a point is in their pictures.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Distances { float distances[]; };
layout(set = 0, binding = 2, std430) readonly buffer Disparities { float disparities[]; };

const float FOCAL_LENGTH = 512.0; // in pixels
const float BASELINE = 0.125;
const float FARTHEST = 1000.0;

float distance_of(float disparity) {
    return FOCAL_LENGTH * BASELINE / disparity;
}

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    float depth = distance_of(disparities[pixel]);
    distances[pixel] = depth;
}
