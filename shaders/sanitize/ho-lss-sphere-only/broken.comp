#version 460
#extension GL_EXT_ray_query : require
#extension GL_NV_linear_swept_spheres : require
//@ flags: -g

// How thick what is above points is: stems, and buds at their ends.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Widths { float widths[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };

const vec3 UP = vec3(0.0, 0.0, 1.0);
const float FAR = 99.0;

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec3 point = points[index].xyz;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xff, point, 0.0, UP, FAR);
    while (rayQueryProceedEXT(query)) {
    }
    float width;
    uint hit = rayQueryGetIntersectionTypeEXT(query, true);
    if (hit == gl_RayQueryCommittedIntersectionNoneEXT) {
        width = 0.0;
    } else {
        float radii[2];
        rayQueryGetIntersectionLSSRadiiNV(query, true, radii);
        width = radii[0] + radii[1];
    }
    widths[index] = width;
}
