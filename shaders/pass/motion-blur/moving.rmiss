#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_ray_tracing_motion_blur : require

// A miss has a time, too.

struct Payload { vec4 a; vec4 b; };
layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.a = vec4(-1.0, gl_CurrentRayTimeNV, 0.0, 0.0);
    payload.b = vec4(0.0, 0.0, 0.0, -1.0);
}
