#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_shader_invocation_reorder : require

// A closest-hit shader that executes a miss.

layout(location = 0) rayPayloadInEXT vec4 payload;

void main() {
    payload.w += 1.0;
    hitObjectEXT object;
    hitObjectRecordMissEXT(object, gl_RayFlagsNoneEXT, 1u, vec3(0.0), 0.0, vec3(0.0, 0.0, 1.0), 3.0);
    hitObjectExecuteShaderEXT(object, 0);
}
