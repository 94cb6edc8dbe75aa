#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// How many leaves are above each point, four at most.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Counts { uint counts[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };

const vec3 UP = vec3(0.0, 0.0, 1.0);
const float FAR = 99.0;
const uint MOST_LEAVES = 4u;

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec3 point = points[index].xyz;
    uint count = 0u;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xff, point, 0.0, UP, FAR);
    for (uint i = 0u; i < MOST_LEAVES; ++i) {
        if (rayQueryProceedEXT(query)) {
            ++count;
        }
    }
    counts[index] = count;
}
