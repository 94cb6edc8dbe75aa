#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_cull_mask : require
#extension GL_GOOGLE_include_directive : require
#include "probe.glsl"

layout(location = 0) rayPayloadInEXT Probe probe;
layout(shaderRecordEXT, std430) buffer Record {
    Plan plan;
};
struct Attributes {
    vec4 first;
    vec4 second;
};
hitAttributeEXT Attributes attributes;

#include "hit.glsl"

void main() {
    note_hit();
    probe.words[STAGE] = 3u;
    probe.words[RECORD] = plan.id;
    for (uint part = 0u; part < 4u; ++part) {
        probe.words[ATTRIBUTE + part] = floatBitsToUint(attributes.first[part]);
        // 32 bytes are what every device holds.
        probe.words[VERTICES + part] = floatBitsToUint(attributes.second[part]);
    }
}
