//! Rules about acceleration structures, and about the hit groups that their geometry leads to.

rules! {
    AS_VERTEX_NAN "as-vertex-nan" UndefinedBehavior
        "A vertex has a NaN in Y or Z only if a vertex of its triangle has one in X."
        "Vulkan, \"Inactive Primitives and Instances\": if any other vertex component is NaN, and the first is not, the behavior is undefined"
        "set X of a vertex to NaN to make its triangles inactive"
    AS_DEGENERATE "as-degenerate" Lint
        "No triangle degenerates to a line or a point, no box to a point, and no radius is 0."
        "Vulkan, \"Degenerate Primitives and Instances\": such a primitive is never hit, and a build may \
         discard it"
        "remove it from the mesh, or make it inactive with a NaN in X"
    AS_NEAR_SINGULAR "as-near-singular" Lint
        "The determinant of an instance's transform is not tiny relative to the lengths of its rows and \
         columns."
        "object-space rays lose the digits that cancel in the inverse of the transform"
        "make the instance thicker along the flattened axis, or build its geometry in world space"
    AS_LSS_CHAIN "as-lss-chain" UndefinedBehavior
        "With chained end caps, either all linear swept spheres of a chain are active, or none is."
        "Vulkan, \"Inactive Primitives and Instances\": if any chain contains both active and inactive primitives, the behavior is undefined"
        "end the chain before the NaN: remove the indices that refer to it"
    AS_MASK_ZERO "as-mask-zero" Lint
        "The mask of an instance shares a bit with the cull mask of some ray."
        "a ray hits an instance only if the instance's mask & the ray's cull mask is not 0"
        "set a mask bit that the cull masks of the intended rays contain, or remove the instance; 0xff is \
         visible to all rays"
    AS_CULL_DISABLED "as-cull-disabled" Lint
        "A ray that culls triangles by facing can reach an instance that allows such culling."
        "TRIANGLE_FACING_CULL_DISABLE of an instance overrides the ray flags CullBackFacingTriangles and \
         CullFrontFacingTriangles"
        "clear the flag of the instances or of the ray"
    ANYHIT_OPAQUE "anyhit-opaque" Lint
        "An any-hit shader belongs to geometry that is not opaque for at least one ray."
        "the any-hit shader of opaque geometry never runs"
        "clear the opaque flag of the geometry or of the rays, or remove the any-hit shader"
    AS_MOTION "as-motion" Lint
        "The rotations of an SRT motion are unit quaternions."
        "VkSRTDataNV: a device may or may not normalize the interpolated quaternion"
        "normalize the quaternion"
    SBT_TRIANGLES_GROUP "sbt-triangles-group" UndefinedBehavior
        "A triangle, sphere or linear swept sphere selects a hit group without an intersection shader."
        "VUID-vkCmdTraceRaysKHR-pHitShaderBindingTable-04735"
        "correct the record index: instance offset + geometry index * SBT stride + SBT offset"
    SBT_PROCEDURAL_GROUP "sbt-procedural-group" UndefinedBehavior
        "A box selects a hit group with an intersection shader, or a null record."
        "VUID-vkCmdTraceRaysKHR-pHitShaderBindingTable-04736"
        "correct the record index: instance offset + geometry index * SBT stride + SBT offset"
    PIPE_MICROMAP_FLAG "pipe-micromap-flag" UndefinedBehavior
        "A pipeline that traces an acceleration structure with opacity micromaps is created with support \
         for them."
        "VUID-vkCmdTraceRaysKHR-micromap-11640"
        "create the pipeline with VK_PIPELINE_CREATE_2_RAY_TRACING_OPACITY_MICROMAP_BIT_KHR"
}
