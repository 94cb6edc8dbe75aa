#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -gVS

layout(set = 0, binding = 2, std430) readonly buffer Normals { vec4 normals[]; };
layout(location = 0) rayPayloadInEXT vec3 colour;

const vec3 TO_SUN = vec3(0.0, 1.0, 0.0);

vec3 world_normal(vec3 object_normal) {
    return normalize(mat3(gl_ObjectToWorldEXT) * object_normal);
}

void main() {
    vec3 normal = world_normal(normals[gl_PrimitiveID].xyz);
    float light = max(dot(normal, TO_SUN), 0.0);
    colour = vec3(1.0, 0.5, 0.25) * light;
}
