#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require

// A miss shader that calls.

struct Sum { uint total; uint addend; };
layout(location = 0) rayPayloadInEXT Sum sum;
layout(location = 1) callableDataEXT Sum inner;

void call(uint n) {
    inner.addend = n;
    executeCallableEXT(0, 1);
}

#include "flow.glsl"

void main() {
    inner = Sum(0u, 0u);
    flow(gl_LaunchIDEXT.x);
    sum.total = inner.total;
}
