#version 460
//@ flags: -g

// Whether points are lit, by a shadow map.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, std430) writeonly buffer Lights { uint is_lit[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; }; // depth in z, cascade in w
layout(set = 0, binding = 3) uniform sampler2D shadow_map;

float occluder_depth(vec4 point) {
    return textureLod(shadow_map, point.xy, 0.0).r;
}

void main() {
    vec4 point = points[gl_GlobalInvocationID.x];
    is_lit[gl_GlobalInvocationID.x] = point.z <= occluder_depth(point) ? 1u : 0u;
}
