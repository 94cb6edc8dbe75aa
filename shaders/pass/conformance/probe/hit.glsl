#include "ray.glsl"

// What closest-hit shaders are told of the hit.
void note_hit() {
    note_ray();
    probe.words[PRIMITIVE] = gl_PrimitiveID;
    probe.words[GEOMETRY] = gl_GeometryIndexEXT;
    probe.words[INSTANCE] = gl_InstanceID;
    probe.words[CUSTOM] = gl_InstanceCustomIndexEXT;
    probe.words[KIND] = gl_HitKindEXT;
    for (uint axis = 0u; axis < 3u; ++axis) {
        probe.words[OBJECT_ORIGIN + axis] = floatBitsToUint(gl_ObjectRayOriginEXT[axis]);
        probe.words[OBJECT_DIRECTION + axis] = floatBitsToUint(gl_ObjectRayDirectionEXT[axis]);
        for (uint column = 0u; column < 4u; ++column) {
            probe.words[OBJECT_TO_WORLD + 3u * column + axis] = floatBitsToUint(gl_ObjectToWorldEXT[column][axis]);
            probe.words[WORLD_TO_OBJECT + 3u * column + axis] = floatBitsToUint(gl_WorldToObjectEXT[column][axis]);
        }
    }
}
