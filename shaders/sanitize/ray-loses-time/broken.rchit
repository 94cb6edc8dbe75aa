#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_NV_ray_tracing_motion_blur : require
//@ flags: -g

// A mirror (custom index 1), in which a wall is seen that moves away.

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) rayPayloadInEXT float depth;
layout(location = 1) rayPayloadEXT float seen;

void main() {
    if (gl_InstanceCustomIndexEXT == 1) {
        vec3 at = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
        vec3 direction = reflect(gl_WorldRayDirectionEXT, vec3(0.0, 0.0, 1.0));
        seen = -1.0;
        traceRayEXT(scene, gl_RayFlagsOpaqueEXT, 0xFF, 0, 1, 0, at, 0.001, direction, 100.0, 1);
        depth = seen;
    } else {
        depth = gl_HitTEXT;
    }
}
