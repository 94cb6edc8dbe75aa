#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// What shines is as bright from all sides.

layout(location = 0) rayPayloadInEXT vec3 color;

void main() {
    color = vec3(8.0);
}
