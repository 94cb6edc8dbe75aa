// Light on a surface: the sun where nothing stands before it, and the sky. For closest-hit shaders.

layout(location = 0) rayPayloadInEXT Payload payload;
layout(location = 1) rayPayloadEXT Shadow shadow;

vec3 shade(vec3 hit, vec3 normal, vec3 albedo, float gloss) {
    vec3 sun = camera.sun_direction_and_intensity.xyz;
    float intensity = camera.sun_direction_and_intensity.w;
    float facing = max(dot(normal, sun), 0.0);
    shadow.light = 0.0;
    if (facing > 0.0) {
        uint flags = gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;
        vec3 origin = hit + normal * SHADOW_OFFSET;
        traceRayEXT(scene, flags, 0xFF, 0, 0, 1, origin, 0.0, sun, T_MAX, 1);
    }
    float light = facing * shadow.light * intensity;
    vec3 mirrored = reflect(gl_WorldRayDirectionEXT, normal);
    float glint = pow(max(dot(mirrored, sun), 0.0), 32.0) * shadow.light * gloss;
    float ambient = 0.25 + 0.15 * normal.y;
    return albedo * (light + ambient) + vec3(glint);
}
