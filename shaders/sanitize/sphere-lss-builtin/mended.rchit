#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_linear_swept_spheres : require
//@ flags: -g

// Beads and the thread between them, in the colours of their normals.

layout(location = 0) rayPayloadInEXT vec3 color;
hitAttributeEXT float along; // of a linear swept sphere

vec3 hit_point() {
    return gl_ObjectRayOriginEXT + gl_HitTEXT * gl_ObjectRayDirectionEXT;
}

void main() {
    vec3 middle;
    if (gl_HitIsSphereNV) {
        middle = gl_HitSpherePositionNV;
    } else {
        middle = mix(gl_HitLSSPositionsNV[0], gl_HitLSSPositionsNV[1], along);
    }
    color = 0.5 + 0.5 * normalize(hit_point() - middle);
}
