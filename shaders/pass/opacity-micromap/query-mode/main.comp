#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_opacity_micromap : require
#extension GL_EXT_opacity_micromap_ray_query_mode : require
//@ flags: -g

// Ray queries that look at opacity micromaps, as a specialization constant says.

layout(constant_id = 0) gl_EnableOpacityMicromapEXT;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) buffer Outputs { uint outputs[]; };

// What becomes of a ray: 0 missed, 1 shown, 2 opaque.
uint look(vec2 at) {
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xFF, vec3(at, 1.0), 0.0, vec3(0.0, 0.0, -1.0), 9.0);
    bool shown = rayQueryProceedEXT(query);
    bool hit = rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT;
    return shown ? 1u : hit ? 2u : 0u;
}

void main() {
    // The middles of the four parts of a triangle at level 1.
    outputs[0] = look(vec2(1.0, 1.0) / 6.0);
    outputs[1] = look(vec2(2.0, 2.0) / 6.0);
    outputs[2] = look(vec2(4.0, 1.0) / 6.0);
    outputs[3] = look(vec2(1.0, 4.0) / 6.0);
}
