#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// How far above each point the lowest leaf is: the holes of leaves are no hits.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Heights { float heights[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };

void main() {
    vec3 point = points[gl_GlobalInvocationID.x].xyz;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xff, point, 0.0, vec3(0, 0, 1), 99.0);
    while (rayQueryProceedEXT(query)) {
        vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, false);
        if (uv.x + uv.y > 0.5) {
            rayQueryConfirmIntersectionEXT(query);
        }
    }
    float height = 99.0;
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT) {
        height = rayQueryGetIntersectionTEXT(query, true);
    }
    heights[gl_GlobalInvocationID.x] = height;
}
