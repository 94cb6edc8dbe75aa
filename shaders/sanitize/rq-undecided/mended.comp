#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// How deep the water is under each boat: the bed is opaque, the weeds on it are not.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Depths { float depths[]; };

void main() {
    vec3 boat = vec3(float(gl_GlobalInvocationID.x), 0.0, 0.0);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xff, boat, 0.0, vec3(0, 0, -1), 99.0);
    while (rayQueryProceedEXT(query)) {
        rayQueryConfirmIntersectionEXT(query);
    }
    float depth = -1.0;
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT) {
        depth = rayQueryGetIntersectionTEXT(query, true);
    }
    depths[gl_GlobalInvocationID.x] = depth;
}
