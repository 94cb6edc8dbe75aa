//! Rules about traces and reports.

rules! {
    RAY_ZERO_DIRECTION "ray-zero-direction" Lint
        "The direction of a ray is not zero, and the square of its length is a normal number."
        "a ray without a direction hits nothing"
        "normalize only non-zero vectors, and end degenerate bounces before the trace"
    RAY_UNKNOWN_FLAG "ray-unknown-flag" UndefinedBehavior
        "Ray flags contain only bits that SPIR-V 3.20, \"Ray Flags\", defines."
        "SPIR-V, \"Ray Flags\""
        "pass gl_RayFlags* constants, combined with |"
    RAY_MASK_BITS "ray-mask-bits" Lint
        "The cull mask of a ray fits in 8 bits, and is not 0."
        "SPV_KHR_ray_tracing, OpTraceRayKHR: only the 8 lowest bits of Cull Mask are used"
        "pass a mask that shares a bit with the masks of the instances to hit; 0xff includes all instances"
    RAY_SBT_BITS "ray-sbt-bits" Lint
        "The SBT offset and stride of a ray fit in 4 bits."
        "SPV_KHR_ray_tracing, OpTraceRayKHR: only the 4 lowest bits of SBT Offset and SBT Stride are used"
        "the operands are, in this order: sbtRecordOffset, sbtRecordStride, missIndex"
    RAY_MISS_BITS "ray-miss-bits" Lint
        "The miss index of a ray fits in 16 bits."
        "SPV_KHR_ray_tracing, OpTraceRayKHR: only the 16 lowest bits of Miss Index are used"
        "the operands are, in this order: sbtRecordOffset, sbtRecordStride, missIndex"
    RAY_SKIP_CAPABILITY "ray-skip-capability" Lint
        "A ray skips triangles or boxes only in a module that declares RayTraversalPrimitiveCullingKHR."
        "SPIR-V 3.20, \"Ray Flags\": SkipTrianglesKHR and SkipAABBsKHR require it; its feature is \
         rayTraversalPrimitiveCulling"
        "in GLSL, write `layout(primitive_culling);` with GL_EXT_ray_flags_primitive_culling; Slang never \
         declares it"
    RAY_ADDRESS_HANDLE "ray-address-handle" UndefinedBehavior
        "The acceleration structure of a ray is not the device address 0."
        "SPV_KHR_ray_tracing, OpConvertUToAccelerationStructureKHR: the operand is the address of an acceleration structure"
        "write the structure's address before the shader reads it; a null descriptor needs no address"
    RAY_MOTION_NEEDS_AS "ray-motion-needs-as" Lint
        "A ray with a time is traced in an acceleration structure that contains motion."
        "VUID-RuntimeSpirv-OpTraceRayMotionNV-06365, OpHitObjectTraceRayMotionNV-07709, flags-11876: the \
         structure must be built for motion, and this one contains none"
        "add `motion` to an instance, or trace without a time; allow the rule if the structure is built \
         for motion"
    CALLABLE_DEPTH "callable-depth" Lint
        "At most two callable shaders of an invocation are in progress, or as many as `max_callable_depth` \
         allows."
        "Vulkan, \"Ray Tracing Pipeline Stack\": the default size of a pipeline's stack is for two of them"
        "set the stack size for this depth with vkCmdSetRayTracingPipelineStackSizeKHR, and set \
         `max_callable_depth` in [pipeline] to it"
    REPORT_NAN_T "report-nan-t" Lint
        "The t of a reported intersection is not a NaN."
        "a NaN is outside every interval, so the report is rejected"
        "test the discriminant before taking its square root"
    REPORT_OUTSIDE_BOX "report-outside-box" Lint
        "At the t of a reported intersection, the ray is inside the candidate's box."
        "Vulkan, \"Ray Traversal\": boxes behind a known hit are skipped, so whether a hit outside its box \
         is found depends on the device"
        "enlarge the box so that it contains the whole primitive"
}
