// What hit and miss shaders are told of the ray.
void note_ray() {
    probe.words[FLAGS] = gl_IncomingRayFlagsEXT;
    probe.words[T_MIN] = floatBitsToUint(gl_RayTminEXT);
    for (uint axis = 0u; axis < 3u; ++axis) {
        probe.words[WORLD_ORIGIN + axis] = floatBitsToUint(gl_WorldRayOriginEXT[axis]);
        probe.words[WORLD_DIRECTION + axis] = floatBitsToUint(gl_WorldRayDirectionEXT[axis]);
        probe.words[LAUNCH + axis] = gl_LaunchIDEXT[axis];
    }
    probe.words[LAUNCH + 3u] = gl_LaunchSizeEXT.x * gl_LaunchSizeEXT.y * gl_LaunchSizeEXT.z;
    probe.words[T_MAX] = floatBitsToUint(gl_RayTmaxEXT);
    probe.words[CULL_MASK] = gl_CullMaskEXT;
}
