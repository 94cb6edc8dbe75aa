#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// A mirror that takes a little of the light.

struct Path {
    vec3 color;
    uint depth;
};

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) rayPayloadInEXT Path path;
layout(location = 1) rayPayloadEXT Path reflected;

const uint MOST_REFLECTIONS = 3u;
const vec3 TINT = vec3(0.875, 1.0, 0.875);

void main() {
    reflected = Path(vec3(0.0), path.depth + 1u);
    vec3 origin = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    vec3 direction = -gl_WorldRayDirectionEXT;
    if (path.depth < MOST_REFLECTIONS) {
        traceRayEXT(scene, gl_RayFlagsOpaqueEXT, 0xFF, 0, 0, 0, origin, 0.001, direction, 99.0, 1);
    }
    path.color = TINT * reflected.color;
}
