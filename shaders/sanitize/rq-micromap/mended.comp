#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_opacity_micromap : require
#extension GL_EXT_opacity_micromap_ray_query_mode : require
//@ flags: -g

// Which points see the sky, past leaves.

const bool gl_EnableOpacityMicromapEXT = true;

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Sky { uint sees_sky[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };

const vec3 UP = vec3(0.0, 0.0, 1.0);
const float FAR = 99.0;

bool is_leaf(vec2 at) {
    uvec2 cell = uvec2(at * 4.0);
    return ((cell.x + cell.y) & 1u) == 0u;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec3 point = points[index].xyz;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xff, point, 0.0, UP, FAR);
    while (rayQueryProceedEXT(query)) {
        if (is_leaf(rayQueryGetIntersectionBarycentricsEXT(query, false))) {
            rayQueryConfirmIntersectionEXT(query);
        }
    }
    uint hit = rayQueryGetIntersectionTypeEXT(query, true);
    sees_sky[index] = hit == gl_RayQueryCommittedIntersectionNoneEXT ? 1u : 0u;
}
