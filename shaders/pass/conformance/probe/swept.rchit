#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_cull_mask : require
#extension GL_NV_linear_swept_spheres : require
#extension GL_GOOGLE_include_directive : require
#include "probe.glsl"

layout(location = 0) rayPayloadInEXT Probe probe;
layout(shaderRecordEXT, std430) buffer Record {
    Plan plan;
};
hitAttributeEXT float u;

#include "hit.glsl"

void main() {
    note_hit();
    probe.words[STAGE] = gl_HitIsSphereNV && !gl_HitIsLSSNV ? 4u : gl_HitIsLSSNV && !gl_HitIsSphereNV ? 5u : 9u;
    probe.words[RECORD] = plan.id;
    probe.words[ATTRIBUTE] = floatBitsToUint(u);
    if (gl_HitIsSphereNV) {
        probe.words[ATTRIBUTE + 1u] = floatBitsToUint(gl_HitSphereRadiusNV);
    } else {
        probe.words[ATTRIBUTE + 1u] = floatBitsToUint(gl_HitLSSRadiiNV[0]);
        probe.words[ATTRIBUTE + 2u] = floatBitsToUint(gl_HitLSSRadiiNV[1]);
    }
    for (uint axis = 0u; axis < 3u; ++axis) {
        if (gl_HitIsSphereNV) {
            probe.words[VERTICES + axis] = floatBitsToUint(gl_HitSpherePositionNV[axis]);
        } else {
            probe.words[VERTICES + axis] = floatBitsToUint(gl_HitLSSPositionsNV[0][axis]);
            probe.words[VERTICES + 3u + axis] = floatBitsToUint(gl_HitLSSPositionsNV[1][axis]);
        }
    }
}
