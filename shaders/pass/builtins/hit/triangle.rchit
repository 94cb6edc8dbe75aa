#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_cull_mask : require
#extension GL_EXT_ray_tracing_position_fetch : require
#extension GL_NV_linear_swept_spheres : require
#extension GL_GOOGLE_include_directive : require
#include "builtins.glsl"

layout(location = 0) rayPayloadInEXT float unused;
hitAttributeEXT vec2 barycentrics;

void main() {
    record(0);
    record_triangle(0);
    outputs[slot()][0].attributes = barycentrics;
}
