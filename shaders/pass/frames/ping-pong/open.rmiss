#version 460
#extension GL_EXT_ray_tracing : require

layout(location = 0) rayPayloadInEXT float open;

void main() {
    open = 1.0;
}
