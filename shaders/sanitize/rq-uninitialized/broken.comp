#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// Which points see the light above them.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Sky { uint sees_sky[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; }; // w: faces the light

const vec3 UP = vec3(0.0, 0.0, 1.0);
const float FAR = 99.0;

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec3 point = points[index].xyz;
    bool faces_light = points[index].w > 0.0;
    rayQueryEXT query;
    if (faces_light) {
        rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xff, point, 0.0, UP, FAR);
    }
    while (rayQueryProceedEXT(query)) {
    }
    uint hit = rayQueryGetIntersectionTypeEXT(query, true);
    bool is_lit = faces_light && hit == gl_RayQueryCommittedIntersectionNoneEXT;
    sees_sky[index] = is_lit ? 1u : 0u;
}
