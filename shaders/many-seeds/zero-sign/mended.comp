#version 460
//@ flags: -g

// The octant of a direction: in which order the children of a node are visited.

layout(local_size_x = 2) in;

layout(set = 0, binding = 1, std430) readonly buffer Rays { vec4 ends[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Octants { uint octants[]; };

void main() {
    vec3 origin = ends[2u * gl_GlobalInvocationID.x].xyz;
    vec3 target = ends[2u * gl_GlobalInvocationID.x + 1u].xyz;
    vec3 direction = target - origin;
    uvec3 negative = uvec3(lessThan(direction, vec3(0.0)));
    octants[gl_GlobalInvocationID.x] = negative.x | negative.y << 1u | negative.z << 2u;
}
