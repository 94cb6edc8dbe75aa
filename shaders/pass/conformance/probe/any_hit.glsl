// Does as its record says. What it wrote before it ignores or terminates counts, what stands behind
// does not run.

layout(location = 0) rayPayloadInEXT Probe probe;
layout(shaderRecordEXT, std430) buffer Record {
    Plan plan;
};

void end_the_search() {
    terminateRayEXT;
    probe.words[NEVER] = 1u;
}

void main() {
    probe.words[ANY_HITS] += 1u;
    probe.words[SEEN_FLAGS] = gl_IncomingRayFlagsEXT;
    probe.words[SEEN_T] = floatBitsToUint(gl_RayTmaxEXT);
    probe.words[SEEN_KIND] = gl_HitKindEXT;
    probe.words[SEEN_RECORD] = plan.id;
    probe.words[SEEN_ATTRIBUTE] = floatBitsToUint(FIRST_ATTRIBUTE);
    probe.words[SEEN_ATTRIBUTE + 1u] = floatBitsToUint(SECOND_ATTRIBUTE);
    if (plan.any_hit == 1u || (plan.any_hit == 3u && gl_PrimitiveID % 2 == 0)) {
        ignoreIntersectionEXT;
        probe.words[NEVER] = 2u;
    }
    if (plan.any_hit == 5u && gl_RayTmaxEXT > 0.5) {
        ignoreIntersectionEXT;
        probe.words[NEVER] = 5u;
    }
    if (plan.any_hit == 2u) {
        terminateRayEXT;
        probe.words[NEVER] = 3u;
    }
    if (plan.any_hit == 4u) {
        end_the_search();
        probe.words[NEVER] = 4u;
    }
}
