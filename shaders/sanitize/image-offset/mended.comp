#version 460
//@ flags: -g

// Blockers of a lamp: four texels of its map at a time, from the point outwards.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Colors { vec4 colors[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; }; // z: how far
layout(set = 0, binding = 3) uniform sampler2D shadow_map;

vec4 blockers(vec2 place, int radius) {
    vec2 texel = 1.0 / vec2(textureSize(shadow_map, 0));
    return textureGather(shadow_map, place + vec2(float(radius), 0.0) * texel);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec4 point = points[index];
    colors[index] = blockers(point.xy, int(point.z));
}
