#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// A ray query for each invocation, down to a triangle.

layout(local_size_x = 4) in;
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) buffer Outputs { float distances[]; };

void main() {
    uint at = gl_GlobalInvocationID.x;
    rayQueryEXT query;
    vec3 origin = vec3(float(at), 0.25, 3.0);
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xFFu, origin, 0.0, vec3(0.0, 0.0, -1.0), 100.0);
    rayQueryProceedEXT(query);
    float t = -1.0;
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
        t = rayQueryGetIntersectionTEXT(query, true);
    }
    distances[at] = t;
}
