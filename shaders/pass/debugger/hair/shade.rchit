#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_linear_swept_spheres : require
//@ flags: -gVS
//@ also bare: -O0

struct Payload {
    vec3 colour;
    float t;
};

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT float u;

vec3 normal_at(vec3 hit) {
    vec3 centre = mix(gl_HitLSSPositionsNV[0], gl_HitLSSPositionsNV[1], u);
    return normalize(hit - centre);
}

void main() {
    vec3 hit = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    vec3 normal = normal_at(hit);
    payload.colour = normal * 0.5 + 0.5;
    payload.t = gl_HitTEXT;
}
