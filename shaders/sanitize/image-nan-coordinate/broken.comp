#version 460
//@ flags: -g

// Depths of points as a lamp sees them: the perspective division gives the place in its map.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Colors { vec4 colors[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 3) uniform sampler2D shadow_map;

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec4 clip = points[index];
    vec2 place = clip.xy / clip.w;
    colors[index] = textureLod(shadow_map, place, 0.0);
}
