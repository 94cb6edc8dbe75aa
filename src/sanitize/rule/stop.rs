//! What ends a run, as rules: those whose breach is a trap with or without the sanitizer, and the
//! limits of this crate. No level lets a run go on behind them.

rules! {
    LOCAL_ARRAY_BOUNDS "local-array-bounds" UndefinedBehavior
        "An index into an array, vector or matrix is inside it, and an offset in a buffer fits in 32 bits."
        "SPIR-V, OpAccessChain; Vulkan, \"Robust Buffer Access\""
        "clamp the index, or test it against the length"
    BUFFER_BOUNDS "buffer-bounds" UndefinedBehavior
        "Every byte of an access lies within the range of its descriptor."
        "Vulkan, \"Out-of-Bounds Memory Access\""
        "test the index against the length of the array, see whether it counts something else, or bind a larger buffer"
    NULL_POINTER "null-pointer" UndefinedBehavior
        "Nothing is accessed through a null pointer."
        "SPIR-V, OpConstantNull"
        "test the pointer first: `p != nullptr` in Slang, `uvec2(p) != uvec2(0)` in GLSL with GL_EXT_buffer_reference_uvec2"
    ADDRESS_RANGE "address-range" UndefinedBehavior
        "A device address lies in a buffer, and the access ends before its end."
        "VUID-RuntimeSpirv-PhysicalStorageBuffer64-11819"
        "test the index by which the pointer was moved, or compare the address with the buffers of the scene"
    ADDRESS_ALIGNED "address-aligned" UndefinedBehavior
        "A device address is a multiple of the Aligned operand of its access."
        "VUID-RuntimeSpirv-PhysicalStorageBuffer64-06315"
        "promise less (buffer_reference_align in GLSL), or align the data"
    ATOMIC_ALIGNED "atomic-aligned" UndefinedBehavior
        "An atomic instruction accesses a multiple of its own size."
        "Vulkan, \"Atomic Operations\""
        "align what it changes to its size: 4 bytes, 8 of a 64-bit integer"
    DESCRIPTOR_MISSING "descriptor-missing" UndefinedBehavior
        "A descriptor that is used is bound, and of the kind that the shader declares."
        "Vulkan, \"Descriptor Sets\""
        "bind it in the scene, or do not use it where the resource is not there"
    IMAGE_PART "image-part" UndefinedBehavior
        "A level whose size is asked for, and a block that is matched, are in the image, as are rows in a share of it."
        "Vulkan, \"Image Query Instructions\"; VK_QCOM_image_processing, \"Block Matching\""
        "compare the level with textureQueryLevels, and the block with textureSize"
    IMAGE_VIEW_MATCH "image-view-match" UndefinedBehavior
        "An image has the dimension, sample count and component type that the shader declares."
        "Vulkan, \"Instruction/Sampler/Image View Validation\""
        "declare the image as it is bound"
    UNREACHABLE "unreachable" UndefinedBehavior
        "OpUnreachable is not executed."
        "SPIR-V, OpUnreachable"
        "return a value on every path of the function; an endless loop without effects may end here, too"
    LOOP_ENDLESS "loop-endless" Limit
        "A loop ends within the fuel and the time of the launch."
        "a limit of this run: fuel, timeout or batch_timeout"
        "look at what the loop's condition depends on, or raise the limit"
    RAY_NAN "ray-nan" UndefinedBehavior
        "No component of a ray or its interval is a NaN."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06358, and the same of other traces and ray queries"
        "look for 0 / 0, the root of a negative number, and a direction that is normalized though its length is 0"
    RAY_INFINITE "ray-infinite" UndefinedBehavior
        "Origin and direction of a ray are finite."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06355, and the same of other traces and ray queries"
        "look for a division by 0, and for a point at the distance of a ray that missed"
    RAY_NEGATIVE_T "ray-negative-t" UndefinedBehavior
        "t_min and t_max of a ray are not negative."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06356, and the same of other traces and ray queries"
        "clamp it at 0"
    RAY_INTERVAL_INVERTED "ray-interval-inverted" UndefinedBehavior
        "t_min of a ray is at most its t_max."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06357, and the same of other traces and ray queries"
        "trace no ray where nothing is left of the interval"
    RAY_OPACITY_FLAGS "ray-opacity-flags" UndefinedBehavior
        "At most one of the flags Opaque, NoOpaque, CullOpaque and CullNoOpaque is set."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06893, and the same of other traces and ray queries"
        "keep one of them: a flag that was set before must be cleared"
    RAY_FACE_FLAGS "ray-face-flags" UndefinedBehavior
        "At most one of the flags that skip triangles or cull a side of them is set."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06892, and the same of other traces and ray queries"
        "keep one of them: a flag that was set before must be cleared"
    RAY_BOTH_SKIPS "ray-both-skips" UndefinedBehavior
        "A ray does not skip both triangles and boxes."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06552, and the same of other traces and ray queries"
        "trace no ray where both are skipped: it meets nothing"
    RAY_SKIP_VS_PIPELINE "ray-skip-vs-pipeline" UndefinedBehavior
        "A ray does not skip what its pipeline leaves."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06553, -06554, and the same of hit objects"
        "drop the flag of the ray or that of the pipeline: together they skip all there is"
    RAY_MOTION_TIME "ray-motion-time" UndefinedBehavior
        "The time of a ray is from 0 to 1."
        "VUID-RuntimeSpirv-OpTraceRayMotionNV-06366"
        "see how the time is made: 0 is the first key of the motion, and 1 the last"
    RAY_NOT_TLAS "ray-not-tlas" UndefinedBehavior
        "A ray is traced in a top-level acceleration structure that exists."
        "VUID-RuntimeSpirv-OpTraceRayKHR-06359, and the same of other traces and ray queries"
        "bind the structure in the scene, or see which element or address is used"
    TRACE_RECURSION "trace-recursion" UndefinedBehavior
        "Traces nest no deeper than the pipeline's maxPipelineRayRecursionDepth."
        "VUID-vkCmdTraceRaysKHR-None-03679"
        "count the depth in the payload, and trace no further at the limit"
    STACK_LIMIT "stack-limit" Limit
        "Shaders that call each other fit on the stack."
        "a limit of this crate; on a device that of the pipeline's stack size"
        "count the depth in the callable data, and call no further at a bound"
    SBT_MISS_CALLABLE "sbt-miss-callable" UndefinedBehavior
        "A miss or callable index is inside its table."
        "Vulkan, \"Shader Binding Table\""
        "compare the index, which counts from 0, with the records of the table"
    SBT_HIT_RECORD "sbt-hit-record" UndefinedBehavior
        "What a ray hits has a record in the hit table."
        "Vulkan, \"Hit Shader Binding Table Indexing Rules\""
        "instance offset + geometry index * stride + offset of the ray must be inside the table"
    RECORD_RANGE "record-range" UndefinedBehavior
        "A shader reads no more than its record holds."
        "Vulkan, \"Shader Record\""
        "give the record its data, or a larger stride"
    PAYLOAD_IDENTICAL "payload-identical" UndefinedBehavior
        "Payloads and callable data of caller and called shader are of one type."
        "VUID-RuntimeSpirv-OpTraceRayKHR-11855"
        "declare the same structure in both shaders, best in a file that both include"
    REPORT_HIT_KIND "report-hit-kind" UndefinedBehavior
        "The hit kind of a report is at most 127."
        "VUID-RuntimeSpirv-OpReportIntersectionKHR-06998"
        "pass a hit kind of 0 to 127; larger numbers fit into hit attributes"
    RQ_UNINITIALIZED "rq-uninitialized" UndefinedBehavior
        "A ray query is initialized before it is used."
        "SPV_KHR_ray_query"
        "call rayQueryInitializeEXT on every path, or leave out what follows where there is no ray"
    RQ_PROCEED_COMPLETE "rq-proceed-complete" UndefinedBehavior
        "A ray query does not proceed after it returned false."
        "SPV_KHR_ray_query, OpRayQueryProceedKHR"
        "loop while rayQueryProceedEXT returns true"
    RQ_CANDIDATE_NONE "rq-candidate-none" UndefinedBehavior
        "The candidate of a ray query is used where the last Proceed returned true."
        "SPV_KHR_ray_query"
        "look at candidates inside the loop over rayQueryProceedEXT; behind it the hit is the committed one (true)"
    RQ_COMMITTED_NONE "rq-committed-none" UndefinedBehavior
        "The committed hit of a ray query is read where there is one."
        "SPV_KHR_ray_query"
        "test rayQueryGetIntersectionTypeEXT(query, true) first"
    RQ_COMMITTED_KIND "rq-committed-kind" UndefinedBehavior
        "What only a triangle has is asked of a triangle."
        "SPV_KHR_ray_query: barycentrics and front face, a candidate's t and its confirmation are of triangles"
        "test rayQueryGetIntersectionTypeEXT first"
    RQ_GENERATE_KIND "rq-generate-kind" UndefinedBehavior
        "What is for boxes alone is asked of a candidate that is a box."
        "SPV_KHR_ray_query, OpRayQueryGenerateIntersectionKHR, OpRayQueryGetIntersectionCandidateAABBOpaqueKHR"
        "test rayQueryGetIntersectionTypeEXT(query, false) first"
    RQ_GENERATE_INTERVAL "rq-generate-interval" UndefinedBehavior
        "A generated hit lies between t_min and the committed hit."
        "VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06353"
        "generate no hit before t_min or behind the committed one, or t_max where there is none"
    RQ_GENERATE_MOTION "rq-generate-motion" UndefinedBehavior
        "No hit is generated in a structure with motion."
        "VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06354"
        "use a structure in which nothing moves, or an intersection shader"
    RQ_MICROMAP "rq-micromap" UndefinedBehavior
        "A shader whose ray queries meet opacity micromaps enables them."
        "SPV_KHR_opacity_micromap; VUID-vkCmdDispatch-micromap-11636, and of each command that dispatches or traces"
        "set the execution mode OpacityMicromapIdKHR: gl_EnableOpacityMicromapEXT = true in GLSL"
    PRIMITIVE_GETTER "ho-lss-sphere-only" UndefinedBehavior
        "What only one kind of primitive has is asked of that kind."
        "SPV_KHR_ray_tracing_position_fetch, SPV_NV_linear_swept_spheres"
        "ask for the kind of the hit first: rayQueryIsSphereHitNV, hitObjectIsLSSHitNV, gl_HitKindEXT"
    BARRIER_DIVERGENT "barrier-divergent" UndefinedBehavior
        "Every invocation of a workgroup comes to a barrier."
        "SPIR-V, OpControlBarrier"
        "move the barrier out of the branch, and return behind it"
    HO_RECORD_RAY "ho-record-ray" UndefinedBehavior
        "The ray of a recorded hit object obeys the rules for rays."
        "SPV_EXT_shader_invocation_reorder"
        "test the ray and its interval before the hit or miss is recorded"
    HO_RECORD_PRIMITIVE "ho-record-primitive" UndefinedBehavior
        "A recorded hit names a primitive that its structure has."
        "SPV_EXT_shader_invocation_reorder"
        "compare the indices with the structure: hits of an older one do not fit"
    HO_UNRECORDED "ho-unrecorded" UndefinedBehavior
        "A hit object is recorded before it is used."
        "SPV_EXT_shader_invocation_reorder"
        "record it on every path: hitObjectRecordEmptyEXT where there is neither hit nor miss"
    HO_EMPTY "ho-empty" UndefinedBehavior
        "The ray of an empty hit object is not read."
        "SPV_EXT_shader_invocation_reorder"
        "test hitObjectIsEmptyEXT first"
    HO_NOT_HIT "ho-not-hit" UndefinedBehavior
        "What only a hit has is asked of a hit object that holds one."
        "SPV_EXT_shader_invocation_reorder"
        "test hitObjectIsHitEXT first"
    SBT_NO_NULL "sbt-no-null" UndefinedBehavior
        "A shader that the pipeline promises is not null."
        "VUID-vkCmdTraceRaysKHR-flags-03511 to -03514"
        "give the group the shader, or drop the flag of the pipeline"
    UNSUPPORTED "unsupported" Gap
        "This crate runs what the module needs."
        "a gap of anyhit, not a mistake of yours"
        "`anyhit inspect` lists what a module needs that is not supported"
}
