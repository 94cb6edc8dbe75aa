#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// The texture coordinates of what is above points: leaves, and a ball in its box.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Places { vec2 places[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };

const vec3 UP = vec3(0.0, 0.0, 1.0);
const float FAR = 99.0;
const vec3 CENTER = vec3(2.0, 0.0, 5.0);
const vec2 NONE = vec2(-1.0);

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec3 point = points[index].xyz;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xff, point, 0.0, UP, FAR);
    while (rayQueryProceedEXT(query)) {
        if (rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionAABBEXT) {
            vec2 aside = point.xy - CENTER.xy;
            float half_height = sqrt(max(1.0 - dot(aside, aside), 0.0));
            rayQueryGenerateIntersectionEXT(query, CENTER.z - half_height - point.z);
        } else {
            rayQueryConfirmIntersectionEXT(query);
        }
    }
    vec2 place = NONE;
    uint hit = rayQueryGetIntersectionTypeEXT(query, true);
    if (hit == gl_RayQueryCommittedIntersectionTriangleEXT) {
        place = rayQueryGetIntersectionBarycentricsEXT(query, true);
    }
    places[index] = place;
}
