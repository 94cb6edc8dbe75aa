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
    REPORT_NAN_T "report-nan-t" Lint
        "The t of a reported intersection is not a NaN."
        "a NaN lies in no interval, so that the report is refused"
        "test the discriminant before its square root is taken"
}
