#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// What is seen from above: a ball of water, through the leaves over it that have holes.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Seen { int seen[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 3, std430) readonly buffer Leaves { uint is_solid[]; };

void main() {
    vec3 point = points[gl_GlobalInvocationID.x].xyz;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xff, point, 0.0, vec3(0, 0, -1), 99.0);
    while (rayQueryProceedEXT(query)) {
        if (rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionAABBEXT) {
            float height = sqrt(max(2.25 - dot(point.xy, point.xy), 0.0));
            rayQueryGenerateIntersectionEXT(query, point.z - 1.5 - height);
        } else {
            int leaf = rayQueryGetIntersectionPrimitiveIndexEXT(query, false);
            if (is_solid[leaf] != 0u) {
                rayQueryConfirmIntersectionEXT(query);
            }
        }
    }
    int instance = -1;
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT) {
        instance = rayQueryGetIntersectionInstanceIdEXT(query, true);
    }
    seen[gl_GlobalInvocationID.x] = instance;
}
