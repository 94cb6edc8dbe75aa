#version 460
#extension GL_EXT_ray_tracing : require

// Leaves its record's number, t, the first attribute and the hit kind.

layout(shaderRecordEXT, std430) buffer Record { float number; };
layout(location = 0) rayPayloadInEXT vec4 payload;
hitAttributeEXT vec2 attributes;

void main() {
    payload += vec4(number, gl_HitTEXT, attributes.x, float(gl_HitKindEXT));
}
