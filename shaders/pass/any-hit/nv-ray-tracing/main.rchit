#version 460
#extension GL_NV_ray_tracing : require

layout(location = 0) rayPayloadInNV vec3 payload;

void main() {
    payload.x = gl_HitTNV;
    payload.z = gl_PrimitiveID + 10 * gl_InstanceCustomIndexNV;
}
