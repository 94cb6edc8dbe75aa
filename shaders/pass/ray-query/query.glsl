// How many candidates a ray down from z = 10 at (x, 0) meets, and the committed t (-1 for none), all confirmed.

vec2 count_down(float x) {
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xFFu, vec3(x, 0.0, 10.0), 0.0, vec3(0.0, 0.0, -1.0), 100.0);
    float shown = 0.0;
    while (rayQueryProceedEXT(query)) {
        shown += 1.0;
        if (rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionAABBEXT) {
            rayQueryGenerateIntersectionEXT(query, 6.5);
        } else {
            rayQueryConfirmIntersectionEXT(query);
        }
    }
    bool hit = rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT;
    return vec2(shown, hit ? rayQueryGetIntersectionTEXT(query, true) : -1.0);
}
