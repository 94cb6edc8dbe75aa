#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 0) rayPayloadInEXT vec4 color;

void main() {
    color = vec4(0.5, 0.75, 1.0, 1.0);
}
