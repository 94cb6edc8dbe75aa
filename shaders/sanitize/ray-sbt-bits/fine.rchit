#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

layout(location = 0) rayPayloadInEXT vec3 color;
hitAttributeEXT vec2 barycentrics;

void main() {
    vec2 ridges = fract(barycentrics * 32.0);
    color = vec3(ridges.x, 0.5 + 0.5 * ridges.y, 0.25);
}
