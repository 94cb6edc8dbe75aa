#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_shader_invocation_reorder : require

// A miss shader that traces a hit object and executes it.

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) rayPayloadInEXT vec4 payload;

void main() {
    payload.w += 2.0;
    hitObjectEXT object;
    vec3 direction = vec3(0.0, 0.0, -1.0);
    hitObjectTraceRayEXT(object, scene, gl_RayFlagsNoneEXT, 0xFFu, 1u, 0u, 0u, vec3(0.25, 0.25, 4.0), 0.0, direction, 9.0, 0);
    hitObjectExecuteShaderEXT(object, 0);
}
