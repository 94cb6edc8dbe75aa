#version 460
//@ flags: -g

// Fog before a background: what is farther away than the fog begins is mixed with it.

layout(local_size_x = 8) in;

layout(set = 0, binding = 1, std430) readonly buffer Depths { float depths[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Picture { vec4 picture[]; };

const float FOG_BEGINS = 4.0;

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    vec3 color = vec3(0.25, 0.5, 0.25);
    float fog;
    if (depths[pixel] > FOG_BEGINS) {
        fog = 1.0 - FOG_BEGINS / depths[pixel];
    }
    picture[pixel] = vec4(mix(color, vec3(0.75), clamp(fog, 0.0, 1.0)), 1.0);
}
