// What the benchmarks' shaders share. Outputs are one vec4 a pixel.
#extension GL_EXT_ray_tracing : require

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Outputs { vec4 pixels[]; };
layout(set = 0, binding = 2, std140) uniform Inputs {
    vec4 eye;
    vec4 forward;
    vec4 right;   // times the tangent of half the field of view
    vec4 up;      // likewise
    vec4 light;   // where it comes from
} inputs;
layout(set = 0, binding = 3, std430) readonly buffer Indices { uint indices[]; };
layout(set = 0, binding = 4, std430) readonly buffer Normals { float normals[]; };
layout(set = 0, binding = 5, std430) readonly buffer Spheres { vec4 spheres[]; };

const float FAR = 10000.0;

// The direction through the centre of a pixel.
vec3 view_direction(uvec2 pixel, uvec2 size) {
    vec2 at = (vec2(pixel) + 0.5) / vec2(size) * 2.0 - 1.0;
    return normalize(inputs.forward.xyz + at.x * inputs.right.xyz - at.y * inputs.up.xyz);
}

uint place(uvec2 pixel, uvec2 size) { return pixel.y * size.x + pixel.x; }

vec3 sky(vec3 direction) { return mix(vec3(1.0), vec3(0.5, 0.7, 1.0), 0.5 * (direction.y + 1.0)); }

// A mixing of 32 bits: each bit of the result depends on each of the argument's.
uint mix_bits(uint x) {
    x ^= x >> 16;
    x *= 0x7FEB352Du;
    x ^= x >> 15;
    x *= 0x846CA68Bu;
    return x ^ x >> 16;
}

float unit_interval(uint x) { return float(mix_bits(x) >> 8) * (1.0 / 16777216.0); }

vec3 corner_normal(uint vertex) { return vec3(normals[3 * vertex], normals[3 * vertex + 1], normals[3 * vertex + 2]); }

vec3 smooth_normal(uint triangle, vec2 barycentrics) {
    vec3 n0 = corner_normal(indices[3 * triangle]);
    vec3 n1 = corner_normal(indices[3 * triangle + 1]);
    vec3 n2 = corner_normal(indices[3 * triangle + 2]);
    return normalize(n0 * (1.0 - barycentrics.x - barycentrics.y) + n1 * barycentrics.x + n2 * barycentrics.y);
}

// Value noise: the eight corners of a lattice cell, blended smoothly.
float noise(vec3 at) {
    const uvec3 STEP = uvec3(0x9E3779B1u, 0x85EBCA77u, 0xC2B2AE3Du);
    vec3 base = floor(at);
    vec3 inside = at - base;
    inside = inside * inside * (3.0 - 2.0 * inside);
    uvec3 cell = uvec3(ivec3(base)) * STEP;
    uint low = cell.x + cell.y + cell.z;
    uint high = low + STEP.z;
    float near_bottom = mix(unit_interval(low), unit_interval(low + STEP.x), inside.x);
    float near_top = mix(unit_interval(low + STEP.y), unit_interval(low + STEP.y + STEP.x), inside.x);
    float far_bottom = mix(unit_interval(high), unit_interval(high + STEP.x), inside.x);
    float far_top = mix(unit_interval(high + STEP.y), unit_interval(high + STEP.y + STEP.x), inside.x);
    return mix(mix(near_bottom, near_top, inside.y), mix(far_bottom, far_top, inside.y), inside.z);
}

// Lambert and a highlight, then haze with the distance.
vec3 lit(vec3 albedo, float diffuse, float highlight, float t) {
    vec3 colour = albedo * (0.15 + 0.85 * diffuse) + 0.2 * highlight;
    return mix(colour, vec3(0.7, 0.8, 0.9), 1.0 - exp(-0.05 * t));
}
