#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_tracing_position_fetch : require
#extension GL_NV_ray_tracing_motion_blur : require

// t, the ray's time, and of the instance at that time: two entries of its matrix, its place, and that of the
// inverse; z of the first vertex, in object space.

struct Payload { vec4 a; vec4 b; };
layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.a = vec4(gl_HitTEXT, gl_CurrentRayTimeNV, gl_ObjectToWorldEXT[0].xy);
    payload.b = vec4(gl_ObjectToWorldEXT[3].z, gl_WorldToObjectEXT[3].z, gl_HitTriangleVertexPositionsEXT[0].z, gl_InstanceID);
}
