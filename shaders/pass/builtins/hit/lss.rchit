#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_cull_mask : require
#extension GL_EXT_ray_tracing_position_fetch : require
#extension GL_NV_linear_swept_spheres : require
#extension GL_GOOGLE_include_directive : require
#include "builtins.glsl"

layout(location = 0) rayPayloadInEXT float unused;
hitAttributeEXT float u;

void main() {
    record(0);
    record_lss(0);
    outputs[slot()][0].attributes = vec2(u, 0.0);
}
