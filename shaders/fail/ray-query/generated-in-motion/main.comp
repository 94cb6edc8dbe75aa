#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// A hit is generated in a box of a structure in which something moves.

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) buffer Outputs { uint outputs[]; };

void main() {
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xFF, vec3(0.0), 0.0, vec3(0.0, 0.0, -1.0), 100.0);
    while (rayQueryProceedEXT(query)) {
        rayQueryGenerateIntersectionEXT(query, 5.0);
    }
    outputs[0] = rayQueryGetIntersectionTypeEXT(query, true);
}
