#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// A ball of radius 1 about the origin of its instance, by ray queries.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Depths { float depths[]; };

void main() {
    rayQueryEXT query;
    vec3 start = vec3(float(gl_GlobalInvocationID.x) * 0.25, 0.25, 4.0);
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xff, start, 0.0, vec3(0, 0, -1), 99.0);
    while (rayQueryProceedEXT(query)) {
        if (rayQueryGetIntersectionTypeEXT(query, false) != gl_RayQueryCandidateIntersectionAABBEXT) {
            continue;
        }
        vec3 origin = rayQueryGetIntersectionObjectRayOriginEXT(query, false);
        vec3 direction = rayQueryGetIntersectionObjectRayDirectionEXT(query, false);
        float a = dot(direction, direction);
        float b = dot(origin, direction);
        float c = dot(origin, origin) - 1.0;
        float discriminant = b * b - a * c;
        if (discriminant >= 0.0) {
            rayQueryGenerateIntersectionEXT(query, (-b - sqrt(discriminant)) / a);
        }
    }
    bool hits = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionGeneratedEXT;
    depths[gl_GlobalInvocationID.x] = hits ? rayQueryGetIntersectionTEXT(query, true) : -1.0;
}
