#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_GOOGLE_include_directive : require
#include "spill.glsl"

// Calls while its own values, payload and attribute are live.

layout(set = 0, binding = 2, std430) buffer Inputs {
    int inputs[];
};
layout(location = 0) rayPayloadInEXT uvec2 payload;
layout(location = 1) callableDataEXT uint data;
hitAttributeEXT uint equal;

void main() {
    const Live before = make(inputs[gl_LaunchIDEXT.x]);
    payload.x = equal;
    data = 1u;
    executeCallableEXT(0, 1);
    payload.x += data - 1002u;
    payload.y = equal_members(before, make(inputs[gl_LaunchIDEXT.x])) + equal - payload.x;
}
