#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_linear_swept_spheres : require

struct Payload {
    vec3 normal;
    float t;
};

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT float u;

void main() {
    vec3 hit = gl_ObjectRayOriginEXT + gl_HitTEXT * gl_ObjectRayDirectionEXT;
    vec3 centre = mix(gl_HitLSSPositionsNV[0], gl_HitLSSPositionsNV[1], u);
    payload.normal = normalize((hit - centre) * mat3(gl_WorldToObjectEXT));
    payload.t = gl_HitTEXT;
}
