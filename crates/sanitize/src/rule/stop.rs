//! What ends a run, as rules: those whose breach is a trap with or without the sanitizer, and the
//! limits of this crate. No level lets a run go on behind them.

rules! {
    LOCAL_ARRAY_BOUNDS "local-array-bounds" UndefinedBehavior
        "An index into an array, vector or matrix is inside it, and an offset in a buffer fits in 32 bits."
        "SPIR-V, OpAccessChain; Vulkan, \"Robust Buffer Access\""
        "clamp the index, or test it against the length"
    BUFFER_BOUNDS "buffer-bounds" UndefinedBehavior
        "Every byte of an access is within the range of its descriptor."
        "Vulkan, \"Out-of-Bounds Memory Access\""
        "test the index against the length of the array, check that it counts the array's elements, or \
         bind a larger buffer"
    NULL_POINTER "null-pointer" UndefinedBehavior
        "Nothing is accessed through a null pointer."
        "SPIR-V, OpConstantNull"
        "test the pointer first: `p != nullptr` in Slang, `uvec2(p) != uvec2(0)` in GLSL with GL_EXT_buffer_reference_uvec2"
    ADDRESS_RANGE "address-range" UndefinedBehavior
        "A device address is in a buffer, and the access ends within the buffer."
        "VUID-RuntimeSpirv-PhysicalStorageBuffer64-11819"
        "test the index from which the pointer was computed, or compare the address with the buffers of \
         the scene"
    ADDRESS_ALIGNED "address-aligned" UndefinedBehavior
        "A device address is a multiple of the Aligned operand of its access."
        "VUID-RuntimeSpirv-PhysicalStorageBuffer64-06315"
        "declare a smaller alignment (buffer_reference_align in GLSL), or align the data"
    ATOMIC_ALIGNED "atomic-aligned" UndefinedBehavior
        "The address of an atomic access is a multiple of its size."
        "Vulkan, \"Atomic Operations\""
        "align the value to its size: 4 bytes, or 8 bytes for a 64-bit integer"
    DESCRIPTOR_MISSING "descriptor-missing" UndefinedBehavior
        "A descriptor that is used is bound, and of the kind that the shader declares."
        "Vulkan, \"Descriptor Sets\""
        "bind it in the scene, or do not use it where the resource is missing"
    IMAGE_PART "image-part" UndefinedBehavior
        "A level whose size is queried, a block that is matched, and a row that is accessed in a share of \
         an image are in the image."
        "Vulkan, \"Image Query Instructions\"; VK_QCOM_image_processing, \"Block Matching\""
        "compare the level with textureQueryLevels, and the block with textureSize"
    IMAGE_VIEW_MATCH "image-view-match" UndefinedBehavior
        "An image has the dimension, sample count and component type that the shader declares."
        "Vulkan, \"Instruction/Sampler/Image View Validation\""
        "declare the type of the image that is bound"
    UNREACHABLE "unreachable" UndefinedBehavior
        "OpUnreachable is not executed."
        "SPIR-V, OpUnreachable"
        "return a value on every path of the function; an endless loop without effects may end here, too"
    ABORT "abort" Lint
        "The shader does not abort."
        "SPV_KHR_abort"
        "the message says what the shader found; an explanation of the invocation shows how it came to it"
    LOOP_ENDLESS "loop-endless" Limit
        "A loop ends within the fuel and the time of the launch."
        "a limit of this run: fuel, timeout or batch_timeout"
        "look at what the loop's condition depends on, or raise the limit"
    RAY_NAN "ray-nan" UndefinedBehavior
        "No component of a ray or its interval is a NaN."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06358, and the same for other traces and ray queries"
        "look for 0 / 0, the square root of a negative number, and a normalized direction of length 0"
    RAY_INFINITE "ray-infinite" UndefinedBehavior
        "The origin and direction of a ray are finite."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06355, and the same for other traces and ray queries"
        "look for a division by 0, and for a point at the distance of a ray that missed"
    RAY_NEGATIVE_T "ray-negative-t" UndefinedBehavior
        "t_min and t_max of a ray are not negative."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06356, and the same for other traces and ray queries"
        "clamp them to 0"
    RAY_INTERVAL_INVERTED "ray-interval-inverted" UndefinedBehavior
        "t_min of a ray is at most its t_max."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06357, and the same for other traces and ray queries"
        "skip the trace if the interval is empty"
    RAY_OPACITY_FLAGS "ray-opacity-flags" UndefinedBehavior
        "At most one of the flags Opaque, NoOpaque, CullOpaque and CullNoOpaque is set."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06893, and the same for other traces and ray queries"
        "keep one of them, and clear flags that were set before"
    RAY_FACE_FLAGS "ray-face-flags" UndefinedBehavior
        "At most one of the flags SkipTriangles, CullBackFacingTriangles and CullFrontFacingTriangles is set."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06892, and the same for other traces and ray queries"
        "keep one of them, and clear flags that were set before"
    RAY_BOTH_SKIPS "ray-both-skips" UndefinedBehavior
        "A ray does not skip both triangles and boxes."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06552, and the same for other traces and ray queries"
        "skip the trace if both flags are set: the ray hits nothing"
    RAY_SKIP_VS_PIPELINE "ray-skip-vs-pipeline" UndefinedBehavior
        "A ray does not skip the only kind of primitive that its pipeline keeps."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06553, -06554, and the same for hit objects"
        "remove the flag of the ray or of the pipeline: together they skip all primitives"
    RAY_MOTION_TIME "ray-motion-time" UndefinedBehavior
        "The time of a ray is from 0 to 1."
        "VUID-RuntimeSpirv-OpTraceRayMotionNV-06366"
        "check how the time is computed: 0 is the first key of the motion, and 1 the last"
    RAY_NOT_TLAS "ray-not-tlas" UndefinedBehavior
        "A ray is traced in a top-level acceleration structure that exists."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06359, and the same for other traces and ray queries"
        "bind the structure in the scene, or check which element or address is used"
    TRACE_RECURSION "trace-recursion" UndefinedBehavior
        "Traces nest no deeper than the pipeline's maxPipelineRayRecursionDepth."
        "VUID-vkCmdTraceRaysKHR-None-03679"
        "count the depth in the payload, and stop tracing at the limit"
    STACK_LIMIT "stack-limit" Limit
        "Shaders that call each other fit on the stack."
        "a limit of anyhit; on a device, the limit is the pipeline's stack size"
        "count the depth in the callable data, and stop calling at a bound"
    SBT_MISS_CALLABLE "sbt-miss-callable" UndefinedBehavior
        "A miss or callable index is inside its table."
        "Vulkan, \"Shader Binding Table\""
        "compare the index, which starts at 0, with the number of records in the table"
    SBT_HIT_RECORD "sbt-hit-record" UndefinedBehavior
        "A primitive that a ray hits has a record in the hit table."
        "Vulkan, \"Hit Shader Binding Table Indexing Rules\""
        "keep instance offset + geometry index * stride + offset of the ray inside the table"
    RECORD_RANGE "record-range" UndefinedBehavior
        "A shader reads only bytes inside its record."
        "Vulkan, \"Shader Record\""
        "add the data to the record, or increase the stride"
    PAYLOAD_IDENTICAL "payload-identical" UndefinedBehavior
        "Caller and called shader declare the same type for a payload or callable data."
        "VUID-RuntimeSpirv-OpTraceRayKHR-11855"
        "declare the same structure in both shaders, ideally in a shared header"
    REPORT_HIT_KIND "report-hit-kind" UndefinedBehavior
        "The hit kind of a report is at most 127."
        "VUID-RuntimeSpirv-OpReportIntersectionKHR-06998"
        "pass a hit kind from 0 to 127, and larger numbers in hit attributes"
    RQ_UNINITIALIZED "rq-uninitialized" UndefinedBehavior
        "A ray query is initialized before it is used."
        "SPV_KHR_ray_query"
        "call rayQueryInitializeEXT on every path, or skip the uses of the query where there is no ray"
    RQ_PROCEED_COMPLETE "rq-proceed-complete" UndefinedBehavior
        "rayQueryProceedEXT is not called again after it has returned false."
        "SPV_KHR_ray_query, OpRayQueryProceedKHR"
        "loop while rayQueryProceedEXT returns true"
    RQ_CANDIDATE_NONE "rq-candidate-none" UndefinedBehavior
        "The candidate of a ray query is used only if the last rayQueryProceedEXT returned true."
        "SPV_KHR_ray_query"
        "read candidates inside the rayQueryProceedEXT loop; after it, read the committed hit (true)"
    RQ_COMMITTED_NONE "rq-committed-none" UndefinedBehavior
        "The committed hit of a ray query is read only if there is one."
        "SPV_KHR_ray_query"
        "test rayQueryGetIntersectionTypeEXT(query, true) first"
    RQ_COMMITTED_KIND "rq-committed-kind" UndefinedBehavior
        "Properties of triangles are read only from triangles."
        "SPV_KHR_ray_query: barycentrics, front face, a candidate's t and its confirmation require a triangle"
        "test rayQueryGetIntersectionTypeEXT first"
    RQ_GENERATE_KIND "rq-generate-kind" UndefinedBehavior
        "Operations on boxes are used only if the candidate is a box."
        "SPV_KHR_ray_query, OpRayQueryGenerateIntersectionKHR, OpRayQueryGetIntersectionCandidateAABBOpaqueKHR"
        "test rayQueryGetIntersectionTypeEXT(query, false) first"
    RQ_GENERATE_INTERVAL "rq-generate-interval" UndefinedBehavior
        "A generated hit is between t_min and the committed hit."
        "VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06353"
        "generate no hit before t_min, or beyond the committed hit (t_max if there is none)"
    RQ_GENERATE_MOTION "rq-generate-motion" UndefinedBehavior
        "No hit is generated in a structure with motion."
        "VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06354"
        "use a structure without motion, or an intersection shader"
    RQ_MICROMAP "rq-micromap" UndefinedBehavior
        "A shader whose ray queries encounter opacity micromaps enables them."
        "SPV_KHR_opacity_micromap; VUID-vkCmdDispatch-micromap-11636, and the same for each command that \
         dispatches or traces"
        "set the execution mode OpacityMicromapIdKHR: gl_EnableOpacityMicromapEXT = true in GLSL"
    PRIMITIVE_GETTER "ho-lss-sphere-only" UndefinedBehavior
        "Properties of one kind of primitive are read only from that kind."
        "SPV_KHR_ray_tracing_position_fetch, SPV_NV_linear_swept_spheres"
        "test the kind of the hit first: rayQueryIsSphereHitNV, hitObjectIsLSSHitNV, gl_HitKindEXT"
    BARRIER_DIVERGENT "barrier-divergent" UndefinedBehavior
        "Every invocation of a workgroup reaches a barrier."
        "SPIR-V, OpControlBarrier"
        "move the barrier out of the branch, and return only after it"
    HO_RECORD_RAY "ho-record-ray" UndefinedBehavior
        "The ray of a recorded hit object obeys the rules for rays."
        "SPV_EXT_shader_invocation_reorder"
        "test the ray and its interval before the hit or miss is recorded"
    HO_RECORD_PRIMITIVE "ho-record-primitive" UndefinedBehavior
        "A recorded hit refers to a primitive of its acceleration structure."
        "SPV_EXT_shader_invocation_reorder"
        "compare the indices with the structure: hits of an older structure may not match"
    HO_UNRECORDED "ho-unrecorded" UndefinedBehavior
        "A hit object is recorded before it is used."
        "SPV_EXT_shader_invocation_reorder"
        "record it on every path: hitObjectRecordEmptyEXT where there is neither hit nor miss"
    HO_EMPTY "ho-empty" UndefinedBehavior
        "The ray of an empty hit object is not read."
        "SPV_EXT_shader_invocation_reorder"
        "test hitObjectIsEmptyEXT first"
    HO_NOT_HIT "ho-not-hit" UndefinedBehavior
        "Properties of a hit are read only from a hit object that contains a hit."
        "SPV_EXT_shader_invocation_reorder"
        "test hitObjectIsHitEXT first"
    SBT_NO_NULL "sbt-no-null" UndefinedBehavior
        "A shader that the flags of the pipeline require is not null."
        "VUID-vkCmdTraceRaysKHR-flags-03511 to -03514"
        "add the shader to the group, or remove the flag of the pipeline"
    UNSUPPORTED "unsupported" Gap
        "anyhit supports what the module requires."
        "a limitation of anyhit, not an error in the module"
        "run `anyhit inspect` to list the unsupported features that a module requires"
}
