// The normal of a linear swept sphere, in two ways.

// Specialise with 0 for the normal by projection, as NVIDIA's tutorial draws it.
layout(constant_id = 0) const uint NORMAL_EXACT = 1u;

// From the axis to the hit at a right angle. It ignores that the radius changes: where it does, the
// surface leans, and this normal is off by asin(|r0 - r1| / |p1 - p0|). On an end cap it is worse.
vec3 projected_normal(vec3 hit, vec3 p0, vec3 p1) {
    vec3 axis = p1 - p0;
    float along = dot(hit - p0, axis) / dot(axis, axis);
    return hit - (p0 + along * axis);
}

// From the centre of the sphere that touches the surface at the hit: u is that sphere's parameter.
// Exact on the caps and between them, in object space.
vec3 exact_normal(vec3 hit, vec3 p0, vec3 p1, float u) {
    return hit - mix(p0, p1, u);
}

#ifdef HIT_SHADER
// The unit normal in world space that the constant asks for.
vec3 world_normal(float u) {
    vec3 p0 = gl_HitLSSPositionsNV[0];
    vec3 p1 = gl_HitLSSPositionsNV[1];
    if (NORMAL_EXACT != 0u) {
        vec3 hit = gl_ObjectRayOriginEXT + gl_HitTEXT * gl_ObjectRayDirectionEXT;
        vec3 normal = exact_normal(hit, p0, p1, u);
        return normalize((normal * gl_WorldToObjectEXT).xyz);
    }
    vec3 hit = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    vec3 world0 = gl_ObjectToWorldEXT * vec4(p0, 1.0);
    vec3 world1 = gl_ObjectToWorldEXT * vec4(p1, 1.0);
    return normalize(projected_normal(hit, world0, world1));
}
#endif
