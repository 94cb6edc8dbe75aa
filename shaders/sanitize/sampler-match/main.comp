#version 460
//@ flags: -g

// How much light comes to points, by a shadow map.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, std430) writeonly buffer Lights { float lights[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 3) uniform sampler2DShadow shadow_map;

void main() {
    vec3 point = points[gl_GlobalInvocationID.x].xyz;
    lights[gl_GlobalInvocationID.x] = textureLod(shadow_map, point, 0.0);
}
