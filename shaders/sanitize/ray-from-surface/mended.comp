#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// Whether the sun shines on the points that a row of pixels sees, by ray queries alone.

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) writeonly buffer Light { float light[]; };

void main() {
    vec3 origin = vec3(0.0, 0.0, 4.0);
    vec3 direction = vec3(float(gl_GlobalInvocationID.x) * 0.1 - 0.2, 0.05, -1.0);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xff, origin, 0.0, direction, 99.0);
    while (rayQueryProceedEXT(query)) {
    }
    vec3 point = origin + rayQueryGetIntersectionTEXT(query, true) * direction;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xff, point, 0.001, vec3(0.5, 0.25, 1.0), 99.0);
    while (rayQueryProceedEXT(query)) {
    }
    bool shines = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT;
    light[gl_GlobalInvocationID.x] = shines ? 1.0 : 0.0;
}
