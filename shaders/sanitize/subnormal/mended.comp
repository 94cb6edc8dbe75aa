#version 460
//@ flags: -g

// Lights that reach a cluster: those of which any light is left get a bit.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Lights { uint reaches[]; };
layout(set = 0, binding = 2, std430) readonly buffer Intensities { vec2 intensities[]; };

const float FAINTEST = 1e-6;

void main() {
    uint light = gl_GlobalInvocationID.x;
    vec2 intensity = intensities[light]; // and the distance
    float irradiance = intensity.x / (intensity.y * intensity.y);
    uint bit = 0u;
    if (irradiance > FAINTEST) {
        bit = 1u;
    }
    reaches[light] = bit;
}
