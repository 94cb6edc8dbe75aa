#version 460
#extension GL_EXT_ray_tracing : require

layout(shaderRecordEXT, std430) buffer Record { float light; } record;

layout(location = 0) rayPayloadInEXT float open;

void main() {
    open = record.light;
}
