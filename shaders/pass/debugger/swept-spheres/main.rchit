#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_linear_swept_spheres : require
//@ flags: -g

// Goes 3 from the begin of the axis of the swept sphere towards its end.

struct Found { vec3 end; uint ignored; };
layout(location = 0) rayPayloadInEXT Found found;

void main() {
    vec3 axis = gl_HitLSSPositionsNV[1] - gl_HitLSSPositionsNV[0];
    float size = length(axis);
    found.end = gl_HitLSSPositionsNV[0] + axis * (3.0 / size);
}
