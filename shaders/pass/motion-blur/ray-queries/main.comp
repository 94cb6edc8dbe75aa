#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_ray_tracing_position_fetch : require

// A query has no time: it sees what moves where it is at time 0.

layout(local_size_x = 4) in;
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) buffer Outputs { vec4 outputs[]; };

void main() {
    uint id = gl_GlobalInvocationID.x;
    // At the three instances, and where the third is at time 1.
    vec3 origin = vec3(id == 0u ? 0.0 : id == 1u ? 10.0 : id == 2u ? 22.0 : 18.0, 0.0, 4.0);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xFF, origin, 0.0, vec3(0.0, 0.0, -1.0), 100.0);
    rayQueryProceedEXT(query);
    outputs[id] = vec4(-1.0);
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT) {
        vec3 vertices[3];
        rayQueryGetIntersectionTriangleVertexPositionsEXT(query, true, vertices);
        mat4x3 placed = rayQueryGetIntersectionObjectToWorldEXT(query, true);
        outputs[id] = vec4(rayQueryGetIntersectionTEXT(query, true), placed[3].z, placed[0].x, vertices[0].z);
    }
}
