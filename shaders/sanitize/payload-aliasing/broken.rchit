#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// A lambertian surface below one light from above, with a shadow ray.

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) rayPayloadInEXT vec4 radiance;
layout(location = 1) rayPayloadEXT vec4 shadow;

void main() {
    radiance = vec4(0.25, 0.25, 0.25, 1.0);
    shadow = vec4(0.0);
    vec3 point = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    uint flags = gl_RayFlagsOpaqueEXT | gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;
    vec3 light = vec3(0.0, 0.0, 1.0);
    traceRayEXT(scene, flags, 0xff, 0, 0, 0, point, 0.001, light, 99.0, 0);
    radiance.rgb *= 1.0 + shadow.a;
}
