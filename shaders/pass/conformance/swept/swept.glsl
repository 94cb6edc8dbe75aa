// Ways to ask what a ray meets first, beside a trace: a ray query and a hit object.

struct Ray {
    vec4 origin_t_min;
    vec4 direction_t_max;
    uvec4 operands; // flags, cull mask, not used, not used
    uvec4 miss_index;
};

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) buffer Probes {
    Probe probes[];
};
layout(set = 0, binding = 2, std430) readonly buffer Rays {
    Ray rays[];
};


Probe empty_probe() {
    Probe probe;
    for (uint word = 0u; word < WORDS; ++word) {
        probe.words[word] = 0u;
    }
    return probe;
}

#ifdef QUERY
Probe ask_query(Ray ray) {
    Probe probe = empty_probe();
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, ray.operands.x | gl_RayFlagsOpaqueEXT, ray.operands.y, ray.origin_t_min.xyz,
        ray.origin_t_min.w, ray.direction_t_max.xyz, ray.direction_t_max.w);
    while (rayQueryProceedEXT(query)) {
        // All is opaque: nothing is a candidate.
        probe.words[NEVER] = 1u;
    }
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT) {
        probe.words[STAGE] = 1u;
    } else {
        const bool sphere = rayQueryIsSphereHitNV(query, true);
        const bool swept = rayQueryIsLSSHitNV(query, true);
        probe.words[STAGE] = sphere && !swept ? 4u : swept && !sphere ? 5u : 9u;
        probe.words[PRIMITIVE] = rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
        probe.words[T_MAX] = floatBitsToUint(rayQueryGetIntersectionTEXT(query, true));
        if (sphere) {
            const vec3 position = rayQueryGetIntersectionSpherePositionNV(query, true);
            probe.words[ATTRIBUTE + 1u] = floatBitsToUint(rayQueryGetIntersectionSphereRadiusNV(query, true));
            for (uint axis = 0u; axis < 3u; ++axis) {
                probe.words[VERTICES + axis] = floatBitsToUint(position[axis]);
            }
        }
        if (swept) {
            probe.words[ATTRIBUTE] = floatBitsToUint(rayQueryGetIntersectionLSSHitValueNV(query, true));
            vec3 positions[2];
            float radii[2];
            rayQueryGetIntersectionLSSPositionsNV(query, true, positions);
            rayQueryGetIntersectionLSSRadiiNV(query, true, radii);
            for (uint end = 0u; end < 2u; ++end) {
                probe.words[ATTRIBUTE + 1u + end] = floatBitsToUint(radii[end]);
                for (uint axis = 0u; axis < 3u; ++axis) {
                    probe.words[VERTICES + 3u * end + axis] = floatBitsToUint(positions[end][axis]);
                }
            }
        }
    }
    return probe;
}
#endif

#ifdef HIT_OBJECT
layout(location = 0) rayPayloadEXT Probe payload;
layout(location = 1) hitObjectAttributeNV float hit_value;

Probe ask_hit_object(Ray ray) {
    Probe probe = empty_probe();
    payload = probe;
    hitObjectNV hit;
    hitObjectTraceRayNV(hit, scene, ray.operands.x | gl_RayFlagsOpaqueEXT, ray.operands.y, ray.operands.z,
        ray.operands.w, ray.miss_index.x, ray.origin_t_min.xyz, ray.origin_t_min.w, ray.direction_t_max.xyz,
        ray.direction_t_max.w, 0);
    if (!hitObjectIsHitNV(hit)) {
        probe.words[STAGE] = 1u;
        return probe;
    }
    const bool sphere = hitObjectIsSphereHitNV(hit);
    const bool swept = hitObjectIsLSSHitNV(hit);
    probe.words[STAGE] = sphere && !swept ? 4u : swept && !sphere ? 5u : 9u;
    probe.words[PRIMITIVE] = hitObjectGetPrimitiveIndexNV(hit);
    probe.words[T_MAX] = floatBitsToUint(hitObjectGetRayTMaxNV(hit));
    if (sphere) {
        const vec3 position = hitObjectGetSpherePositionNV(hit);
        probe.words[ATTRIBUTE + 1u] = floatBitsToUint(hitObjectGetSphereRadiusNV(hit));
        for (uint axis = 0u; axis < 3u; ++axis) {
            probe.words[VERTICES + axis] = floatBitsToUint(position[axis]);
        }
    }
    if (swept) {
        hitObjectGetAttributesNV(hit, 1);
        probe.words[ATTRIBUTE] = floatBitsToUint(hit_value);
        vec3 positions[2];
        float radii[2];
        hitObjectGetLSSPositionsNV(hit, positions);
        hitObjectGetLSSRadiiNV(hit, radii);
        for (uint end = 0u; end < 2u; ++end) {
            probe.words[ATTRIBUTE + 1u + end] = floatBitsToUint(radii[end]);
            for (uint axis = 0u; axis < 3u; ++axis) {
                probe.words[VERTICES + 3u * end + axis] = floatBitsToUint(positions[end][axis]);
            }
        }
    }
    return probe;
}
#endif
