#version 460
#extension GL_EXT_ray_tracing : require

// Leaves its record's number, t max and the ray's flags.

layout(shaderRecordEXT, std430) buffer Record { float number; };
layout(location = 0) rayPayloadInEXT vec4 payload;

void main() {
    payload += vec4(number, gl_RayTmaxEXT, float(gl_IncomingRayFlagsEXT), 0.0);
}
