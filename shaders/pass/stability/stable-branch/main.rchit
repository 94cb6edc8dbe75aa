#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// A checkerboard with tiles around the points where the rays come down.

layout(location = 0) rayPayloadInEXT vec3 colour;

void main() {
    vec3 p = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    int column = int(floor(p.x / 3.0 + 0.5));
    if ((column & 1) == 0) {
        colour = vec3(1.0);
    } else {
        colour = vec3(0.25);
    }
}
