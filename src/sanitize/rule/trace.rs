//! Rules about traces and reports.

rules! {
    RAY_ZERO_DIRECTION "ray-zero-direction" Lint
        "The direction of a ray is not zero, and the square of its length is a normal number."
        "a ray without a direction meets nothing"
        "normalize only vectors that are not zero, and give degenerate bounces up before the trace"
    RAY_UNKNOWN_FLAG "ray-unknown-flag" UndefinedBehavior
        "Ray flags have no other bits than those of SPIR-V 3.20, \"Ray Flags\"."
        "SPIR-V, \"Ray Flags\""
        "pass gl_RayFlags* constants, combined by |"
    RAY_MASK_BITS "ray-mask-bits" Lint
        "The cull mask of a ray fits in 8 bits, and is not 0."
        "SPV_KHR_ray_tracing, OpTraceRayKHR: only the 8 lowest bits of Cull Mask are used"
        "an instance is hit where its mask & the ray's mask is not 0: 0xff sees all"
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
        "SPIR-V 3.20, \"Ray Flags\": SkipTrianglesKHR and SkipAABBsKHR need it; its feature is rayTraversalPrimitiveCulling"
        "GLSL: `layout(primitive_culling);` with GL_EXT_ray_flags_primitive_culling; Slang declares it nowhere"
    RAY_ADDRESS_HANDLE "ray-address-handle" UndefinedBehavior
        "The acceleration structure of a ray is not the device address 0."
        "SPV_KHR_ray_tracing, OpConvertUToAccelerationStructureKHR: the operand is the address of an acceleration structure"
        "write the structure's address before the shader reads it; a null descriptor needs no address"
    RAY_MOTION_NEEDS_AS "ray-motion-needs-as" Lint
        "A ray that has a time is traced in an acceleration structure in which something moves."
        "VUID-RuntimeSpirv-OpTraceRayMotionNV-06365, OpHitObjectTraceRayMotionNV-07709, flags-11876: the structure is \
         built for motion, which nothing in it tells here"
        "give an instance `motion`, or trace without a time; allow the rule for a structure that is built for motion"
    CALLABLE_DEPTH "callable-depth" Lint
        "No more than two callable shaders of an invocation are in progress, unless `max_callable_depth` says how many."
        "Vulkan, \"Ray Tracing Pipeline Stack\": the default size of a pipeline's stack is for two of them"
        "set the stack's size for that many by vkCmdSetRayTracingPipelineStackSizeKHR, and say so by \
         `max_callable_depth` of [pipeline]"
    REPORT_NAN_T "report-nan-t" Lint
        "The t of a reported intersection is not a NaN."
        "a NaN lies in no interval, so that the report is refused"
        "test the discriminant before its square root is taken"
    REPORT_OUTSIDE_BOX "report-outside-box" Lint
        "The t of a reported intersection is one at which the ray is within the candidate's box."
        "Vulkan, \"Ray Traversal\": boxes behind a known hit are left out, so that which hits outside of boxes are seen \
         depends on the device"
        "make the box so large that it holds all of the primitive"
}
