#version 460
//@ flags: -g

// Mirrored rays, by the normals of the two ends of an edge.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Directions { vec4 directions[]; };
layout(set = 0, binding = 2, std430) readonly buffer Hits { vec4 hits[]; }; // x: along the edge

const vec3 FROM = vec3(0.0, 1.0, 0.0);
const vec3 TO = vec3(1.0, 0.0, 0.0);

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec3 incident = vec3(0.6, -0.8, 0.0);
    vec3 normal = normalize(mix(FROM, TO, hits[index].x));
    directions[index] = vec4(reflect(incident, normal), 0.0);
}
