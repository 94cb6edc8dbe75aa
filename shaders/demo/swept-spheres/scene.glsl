// What all stages of the demo share: resources, payloads, light. The Slang version does the same
// arithmetic in the same order.

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 2, std140) uniform Camera {
    mat4 view_inverse;
    mat4 projection_inverse;
    vec4 sun_direction_and_intensity; // towards the sun, of length 1
} camera;
layout(set = 0, binding = 3) uniform sampler2D palette;

struct Payload {
    vec3 colour;
};

struct Shadow {
    float light; // 1 where the sun is seen
};

const float T_MAX = 10000.0;
// Far enough that a ray which starts on a swept sphere does not meet the same one again.
const float SHADOW_OFFSET = 0.01;

// The rows of the palette: four bands, from left to right the tints of one material.
const float BAND_GRASS = 0.125;
const float BAND_SPHERES = 0.375;
const float BAND_CHAINS = 0.625;
const float BAND_GROUND = 0.875;

vec3 sky(vec3 direction) {
    vec3 sun = camera.sun_direction_and_intensity.xyz;
    float height = clamp(direction.y * 0.5 + 0.5, 0.0, 1.0);
    vec3 colour = mix(vec3(0.80, 0.78, 0.72), vec3(0.22, 0.42, 0.75), height);
    float towards_sun = max(dot(direction, sun), 0.0);
    return colour + vec3(1.0, 0.85, 0.6) * pow(towards_sun, 256.0);
}

// A number in [0, 1) that differs from one primitive to the next.
float tint(int primitive) {
    uint mixed = (uint(primitive) + 1u) * 2654435769u;
    return float(mixed >> 8u) * (1.0 / 16777216.0);
}

vec3 material(float along, float band) {
    return textureLod(palette, vec2(along, band), 0.0).xyz;
}
