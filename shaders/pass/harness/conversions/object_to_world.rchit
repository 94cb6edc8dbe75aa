#version 460
#extension GL_EXT_ray_tracing : require

// Returns a builtin matrix of four columns with three rows.

layout(location = 0) rayPayloadInEXT mat4x3 transform;

void main() {
    transform = gl_ObjectToWorldEXT;
}
