#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// How far above each point a ball is, of which there are boxes in the scene.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Heights { float heights[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };

const vec3 UP = vec3(0.0, 0.0, 1.0);
const float FAR = 99.0;
const vec3 CENTER = vec3(2.0, 0.0, 5.0);

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec3 point = points[index].xyz;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xff, point, 0.0, UP, FAR);
    while (rayQueryProceedEXT(query)) {
        if (rayQueryGetIntersectionTypeEXT(query, false) != gl_RayQueryCandidateIntersectionAABBEXT) {
            continue;
        }
        vec2 aside = point.xy - CENTER.xy;
        float half_height = sqrt(max(1.0 - dot(aside, aside), 0.0));
        rayQueryGenerateIntersectionEXT(query, CENTER.z - half_height - point.z);
    }
    float height = FAR;
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT) {
        height = rayQueryGetIntersectionTEXT(query, true);
    }
    heights[index] = height;
}
