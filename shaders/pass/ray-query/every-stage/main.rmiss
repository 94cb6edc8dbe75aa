#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_query : require
#extension GL_GOOGLE_include_directive : require

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) buffer Outputs { vec2 outputs[]; };

#include "../query.glsl"

void main() {
    outputs[5] = count_down(4.0);
}
