#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_ray_cull_mask : require

// A miss knows its ray only.

struct Missed {
    uvec4 launch;
    vec4 origin_t_min;
    vec4 direction_t_max;
    uvec4 flags_mask;
};

layout(set = 0, binding = 3, std430) buffer Misses { Missed misses[]; };
layout(location = 0) rayPayloadInEXT float unused;

void main() {
    uint ray = gl_LaunchIDEXT.y * gl_LaunchSizeEXT.x + gl_LaunchIDEXT.x;
    misses[ray].launch = uvec4(gl_LaunchIDEXT, gl_LaunchSizeEXT.x);
    misses[ray].origin_t_min = vec4(gl_WorldRayOriginEXT, gl_RayTminEXT);
    misses[ray].direction_t_max = vec4(gl_WorldRayDirectionEXT, gl_RayTmaxEXT);
    misses[ray].flags_mask = uvec4(gl_IncomingRayFlagsEXT, gl_CullMaskEXT, 1u, 0u);
}
