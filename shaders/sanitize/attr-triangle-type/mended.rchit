#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// Vertex colours of a triangle: red, green and blue, each with the weight of its vertex.

layout(location = 0) rayPayloadInEXT vec3 color;
hitAttributeEXT vec2 weights;

const vec3 COLORS[3] = vec3[3](vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0));

void main() {
    float first = 1.0 - weights.x - weights.y;
    color = first * COLORS[0] + weights.x * COLORS[1] + weights.y * COLORS[2];
}
