#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// Colors what is hit by its height.

layout(location = 0) rayPayloadInEXT vec3 color;

void main() {
    float height = gl_WorldRayOriginEXT.y - gl_HitTEXT;
    color = vec3(0.25 + 0.5 * height, 0.25, 0.25);
}
