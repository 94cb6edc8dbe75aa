#version 460
//@ flags: -g

// Moments of a pixel's samples, from which a denoiser computes their variance.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Moments { vec2 moments[]; };
layout(set = 0, binding = 2, std430) readonly buffer Radiances { float radiances[]; };

const float BRIGHTEST = 65504.0;

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    float radiance = radiances[pixel];
    float square = radiance * radiance;
    moments[pixel] = vec2(radiance, square);
}
