#version 460
//@ flags: -g

// Fog along a ray, in steps of one millimetre.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Densities { float densities[]; };
layout(set = 0, binding = 2, std430) readonly buffer Spans { vec2 spans[]; };

const float STEP = 1.0;
const uint MOST_STEPS = 64u;

void main() {
    uint ray = gl_GlobalInvocationID.x;
    vec2 span = spans[ray];
    float density = 0.0;
    uint steps = 0u;
    for (float t = span.x; t < span.y && steps < MOST_STEPS; t += STEP) {
        density += 0.125 * fract(t * 0.5);
        steps++;
    }
    densities[ray] = density;
}
