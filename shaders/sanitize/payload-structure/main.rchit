#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

struct Hit {
    vec3 color;
    float distance; // negative in the sky
    vec3 normal;
};

layout(location = 0) rayPayloadInEXT Hit hit;

void main() {
    hit.color = vec3(0.5, 0.25, 0.125);
    hit.distance = gl_HitTEXT;
    hit.normal = vec3(0.0, 1.0, 0.0);
}
