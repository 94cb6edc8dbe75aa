#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

struct Surface {
    float t;
    vec3 color;
};

layout(location = 0) rayPayloadInEXT Surface surface;

void main() {
    surface.t = 1000.0;
    surface.color = vec3(0.25, 0.5, 1.0);
}
