#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_tracing_position_fetch : require
//@ flags: -g

// The shader of whatever has no material: flat triangles, and balls in boxes.

layout(location = 0) rayPayloadInEXT vec3 color;

const vec3 TO_SUN = vec3(0.48, 0.6, 0.64);

vec3 face_normal() {
    vec3 a = gl_HitTriangleVertexPositionsEXT[0];
    vec3 b = gl_HitTriangleVertexPositionsEXT[1];
    vec3 c = gl_HitTriangleVertexPositionsEXT[2];
    return normalize(cross(b - a, c - a));
}

vec3 ball_normal() {
    return normalize(gl_ObjectRayOriginEXT + gl_HitTEXT * gl_ObjectRayDirectionEXT);
}

void main() {
    vec3 normal = face_normal();
    color = vec3(0.75) * max(dot(normal, TO_SUN), 0.0);
}
