#version 460
//@ flags: -g

// Which points lie in front of a portal: a plane through a point of it.

layout(local_size_x = 2) in;

layout(set = 0, binding = 1, std430) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Sides { uint sides[]; };

const vec3 NORMAL = vec3(1.0, 1.0, 1.0);
const vec3 CENTRE = vec3(16777216.0, 0.0, -16777216.0);

void main() {
    vec3 point = points[gl_GlobalInvocationID.x].xyz;
    float distance = dot(NORMAL, point);
    sides[gl_GlobalInvocationID.x] = distance > 0.0 ? 1u : 0u;
}
