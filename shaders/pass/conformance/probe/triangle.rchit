#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_cull_mask : require
#extension GL_EXT_ray_tracing_position_fetch : require
#extension GL_GOOGLE_include_directive : require
#include "probe.glsl"

layout(location = 0) rayPayloadInEXT Probe probe;
layout(shaderRecordEXT, std430) buffer Record {
    Plan plan;
};
hitAttributeEXT vec2 barycentrics;

#include "hit.glsl"

void main() {
    note_hit();
    probe.words[STAGE] = 2u;
    probe.words[RECORD] = plan.id;
    probe.words[ATTRIBUTE] = floatBitsToUint(barycentrics.x);
    probe.words[ATTRIBUTE + 1u] = floatBitsToUint(barycentrics.y);
    for (uint corner = 0u; corner < 3u; ++corner) {
        for (uint axis = 0u; axis < 3u; ++axis) {
            probe.words[VERTICES + 3u * corner + axis] =
                floatBitsToUint(gl_HitTriangleVertexPositionsEXT[corner][axis]);
        }
    }
}
