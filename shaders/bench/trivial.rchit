#version 460
#extension GL_EXT_ray_tracing : require

layout(location = 0) rayPayloadInEXT vec4 colour;
hitAttributeEXT vec2 attributes;

void main() { colour = vec4(attributes, uintBitsToFloat(uint(gl_PrimitiveID)), gl_HitTEXT); }
