#version 460
//@ flags: -g

// Blockers of a lamp: four texels of its map at a time, from the point outwards.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Colors { vec4 colors[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; }; // z: how far
layout(set = 0, binding = 3) uniform sampler2D shadow_map;

vec4 blockers(vec2 place, int radius) {
    return textureGatherOffset(shadow_map, place, ivec2(radius, 0));
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec4 point = points[index];
    colors[index] = blockers(point.xy, int(point.z));
}
