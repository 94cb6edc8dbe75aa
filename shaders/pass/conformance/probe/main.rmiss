#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_cull_mask : require
#extension GL_GOOGLE_include_directive : require
#include "probe.glsl"

layout(location = 0) rayPayloadInEXT Probe probe;
layout(shaderRecordEXT, std430) buffer Record {
    uint id;
};

#include "ray.glsl"

void main() {
    note_ray();
    probe.words[STAGE] = 1u;
    probe.words[RECORD] = id;
}
