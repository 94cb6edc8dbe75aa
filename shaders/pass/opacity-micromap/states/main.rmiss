#version 460
#extension GL_EXT_ray_tracing : require

layout(location = 0) rayPayloadInEXT ivec2 payload;

void main() {
    payload.x = 0;
}
