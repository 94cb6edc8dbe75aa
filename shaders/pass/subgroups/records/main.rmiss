#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_KHR_shader_subgroup_arithmetic : require

layout(location = 0) rayPayloadInEXT uvec2 payload;

void main() {
    payload = uvec2(50 + subgroupAdd(1u), 0);
}
