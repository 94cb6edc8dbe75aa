#version 460
#extension GL_EXT_ray_query : require

// A ray for each invocation; the hits of a workgroup are counted together.

layout(local_size_x = 16, local_size_y = 4) in;
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) buffer Outputs { uint hits[]; };

shared uint total;

void main() {
    if (gl_LocalInvocationIndex == 0u) {
        total = 0u;
    }
    barrier();
    rayQueryEXT query;
    vec3 origin = vec3(vec2(gl_GlobalInvocationID.xy) + 0.5, 4.0);
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xFFu, origin, 0.0, vec3(0.0, 0.0, -1.0), 100.0);
    rayQueryProceedEXT(query);
    bool hit = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT;
    if (hit && rayQueryGetIntersectionTEXT(query, true) == 4.0) {
        atomicAdd(total, 1u);
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        hits[gl_WorkGroupID.y] = total;
    }
}
