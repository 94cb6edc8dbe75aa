#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 0) rayPayloadInEXT vec3 color;

void main() {
    color = vec3(0.5, 0.75, 1.0);
}
