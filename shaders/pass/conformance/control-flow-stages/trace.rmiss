#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require

// A miss shader that traces.

struct Sum { uint total; uint addend; };
layout(location = 0) rayPayloadInEXT Sum sum;
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 1) rayPayloadEXT Sum inner;

void call(uint n) {
    inner.addend = n;
    traceRayEXT(scene, 0u, 0, 0, 0, 2, vec3(0.0), 0.0, vec3(0.0, 0.0, 1.0), 1.0, 1);
}

#include "flow.glsl"

void main() {
    inner = Sum(0u, 0u);
    flow(gl_LaunchIDEXT.x);
    sum.total = inner.total;
}
