//! Lints about what rays do together: candidates, records, times, origins and payloads.

rules! {
    RQ_UNDECIDED "rq-undecided" Lint
        "Candidates of a ray query are confirmed, generated in or read before its committed hit is used."
        "GLSL_EXT_ray_query, rayQueryConfirmIntersectionEXT: a candidate that is neither confirmed nor generated in is \
         dropped; only opaque triangles, spheres and swept spheres are committed without it"
        "confirm or generate hits inside the loop over rayQueryProceedEXT, or make the geometry or the query opaque \
         (gl_RayFlagsOpaqueEXT)"
    WORLD_RAY_IN_INTERSECTION "world-ray-in-intersection" Lint
        "An intersection shader intersects a transformed instance's primitives with the ray in object space."
        "Vulkan, \"Built-In Variables\": WorldRayOriginKHR and WorldRayDirectionKHR are in world space; boxes are in the \
         object space of their instance, as ObjectRayOriginKHR and ObjectRayDirectionKHR are"
        "use gl_ObjectRayOriginEXT and gl_ObjectRayDirectionEXT (t is the same in both spaces), or apply gl_WorldToObjectEXT"
    SBT_RECORD_UNREACHED "sbt-record-unreached" Lint
        "Each record with a shader has an index to which some ray or call of the pipeline's shaders can lead."
        "Vulkan, \"Shader Binding Table\": hit record = instance offset + geometry index * SBT stride + SBT offset; a \
         miss or callable record is chosen by its index alone"
        "correct the SBT offset, stride or index that the shader gives, or the instance's offset; or leave the record out"
    RAY_LOSES_TIME "ray-loses-time" Lint
        "A ray that a shader called by a ray with a time traces into moving geometry has a time, too."
        "SPV_NV_ray_tracing_motion_blur: without a time, a ray sees the structure at time 0"
        "pass gl_CurrentRayTimeNV on with traceRayMotionNV"
    RAY_FROM_SURFACE "ray-from-surface" Lint
        "A ray that begins on a surface that a ray has hit has a t_min above 0, or an origin beside the surface."
        "Vulkan, \"Ray Intersection Candidate Determination\": every primitive within the interval is a candidate; the \
         origin, rounded, lies on either side of the surface that it leaves"
        "move the origin along the normal by more than its rounding error, or pass a small t_min"
    PAYLOAD_UNREAD "payload-unread" Lint
        "What called shaders write to a payload or callable data is read by its caller, or by another called shader."
        "a value that nobody reads has no effect: often the caller reads another variable, of another location"
        "read the variable that the trace names, or leave the writes out"
}
