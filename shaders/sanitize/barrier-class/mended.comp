#version 460
//@ flags: -g

// The weights of the lights of a tile, first as powers and then as a share of the strongest one.

layout(local_size_x = 8) in;

layout(set = 0, binding = 1, std430) buffer Weights { float weights[]; };
layout(set = 0, binding = 2, std430) readonly buffer Lights { vec4 lights[]; };
layout(push_constant) uniform Tile { float strongest; };

void main() {
    uint light = gl_LocalInvocationIndex;
    vec3 power = lights[light].rgb;
    weights[light] = max(power.r, max(power.g, power.b)) * lights[light].a;
    memoryBarrierBuffer();
    barrier();
    weights[light] = weights[light] / strongest;
}
