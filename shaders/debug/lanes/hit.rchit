#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_KHR_shader_subgroup_arithmetic : require
//@ flags: -gVS

layout(location = 0) rayPayloadInEXT uint payload;

void main() {
    uint place = gl_PrimitiveID + 5;
    payload += place + subgroupAdd(1u);
}
