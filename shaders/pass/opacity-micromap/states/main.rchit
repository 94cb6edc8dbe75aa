#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_cluster_acceleration_structure : require

layout(location = 0) rayPayloadInEXT ivec2 payload;

void main() {
    payload = ivec2(payload.x == 5 ? 1 : 2, gl_ClusterIDNV);
}
