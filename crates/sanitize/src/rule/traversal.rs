//! Lints about what rays do together: candidates, records, times, origins and payloads.

rules! {
    RQ_UNDECIDED "rq-undecided" Lint
        "Candidates of a ray query are confirmed, generated or read before its committed hit is used."
        "GLSL_EXT_ray_query, rayQueryConfirmIntersectionEXT: a candidate that is neither confirmed nor \
         generated is dropped; only opaque triangles, spheres and linear swept spheres are committed \
         without it"
        "confirm or generate hits inside the rayQueryProceedEXT loop, or make the geometry or the query \
         opaque (gl_RayFlagsOpaqueEXT)"
    WORLD_RAY_IN_INTERSECTION "world-ray-in-intersection" Lint
        "An intersection shader intersects the primitives of a transformed instance with the object-space ray."
        "Vulkan, \"Built-In Variables\": WorldRayOriginKHR and WorldRayDirectionKHR are in world space; boxes are in the \
         object space of their instance, as ObjectRayOriginKHR and ObjectRayDirectionKHR are"
        "use gl_ObjectRayOriginEXT and gl_ObjectRayDirectionEXT (t is the same in both spaces), or apply gl_WorldToObjectEXT"
    SBT_RECORD_UNREACHED "sbt-record-unreached" Lint
        "Each record with a shader can be selected by some ray or call of the pipeline's shaders."
        "Vulkan, \"Shader Binding Table\": hit record = instance offset + geometry index * SBT stride + \
         SBT offset; a miss or callable record is selected by its index alone"
        "correct the SBT offset, stride or index in the shader, or the instance's offset; or remove the record"
    RAY_LOSES_TIME "ray-loses-time" Lint
        "A shader that is called for a ray with a time passes a time to the rays that it traces into \
         moving geometry."
        "SPV_NV_ray_tracing_motion_blur: without a time, a ray sees the structure at time 0"
        "pass gl_CurrentRayTimeNV to traceRayMotionNV"
    RAY_FROM_SURFACE "ray-from-surface" Lint
        "A ray that starts on a surface that a ray has hit has a t_min above 0, or an origin offset from \
         the surface."
        "Vulkan, \"Ray Intersection Candidate Determination\": every primitive within the interval is a \
         candidate; the rounded origin may be on either side of the surface that the ray leaves"
        "move the origin along the normal by more than its rounding error, or pass a small t_min"
    PAYLOAD_UNREAD "payload-unread" Lint
        "Values that called shaders write to a payload or callable data are read by the caller, or by \
         another called shader."
        "an unread value has no effect; often the caller reads another variable, with a different location"
        "read the variable that the trace passes, or remove the writes"
}
