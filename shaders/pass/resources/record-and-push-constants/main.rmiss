#version 460
#extension GL_EXT_ray_tracing : require

layout(shaderRecordEXT, std430) buffer Record { vec4 background; };
layout(location = 0) rayPayloadInEXT vec4 answer;

void main() {
    answer = background;
}
