#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_query : require
#include "bench.glsl"

// One ray query a pixel, through opaque triangles.

layout(local_size_x = 32) in;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    uvec2 size = gl_NumWorkGroups.xy * gl_WorkGroupSize.xy;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xFF, inputs.eye.xyz, 0.001, view_direction(pixel, size), FAR);
    while (rayQueryProceedEXT(query)) {
    }
    vec4 found = vec4(0.0, 0.0, 0.0, -1.0);
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
        found = vec4(rayQueryGetIntersectionBarycentricsEXT(query, true),
                     uintBitsToFloat(uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true))),
                     rayQueryGetIntersectionTEXT(query, true));
    }
    pixels[place(pixel, size)] = found;
}
