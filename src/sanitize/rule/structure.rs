//! Rules about acceleration structures, and about the hit groups that their geometry leads to.

rules! {
    AS_VERTEX_NAN "as-vertex-nan" UndefinedBehavior
        "A vertex has a NaN in Y or Z only where a vertex of its triangle has one in X."
        "Vulkan, \"Inactive Primitives and Instances\": if any other vertex component is NaN, and the first is not, the behavior is undefined"
        "set X of a vertex to a NaN to make its triangles inactive"
    AS_DEGENERATE "as-degenerate" Lint
        "No triangle is a line or a point by its coordinates, no box a point, and no radius is 0."
        "Vulkan, \"Degenerate Primitives and Instances\": such a primitive is not hit, and a build may leave it out"
        "leave it out of the mesh, or make it inactive with a NaN in X"
    AS_NEAR_SINGULAR "as-near-singular" Lint
        "The determinant of an instance's transform is not tiny against the lengths of its rows and of its columns."
        "rays in object space lose the digits that cancel in the inverse of the transform"
        "make the instance thicker along the axis that is squeezed, or build its geometry in world space"
    AS_LSS_CHAIN "as-lss-chain" UndefinedBehavior
        "With chained end caps, all linear swept spheres of a chain are active, or none is."
        "Vulkan, \"Inactive Primitives and Instances\": if any chain contains both active and inactive primitives, the behavior is undefined"
        "end the chain before the NaN: leave the indices out that name it"
    AS_MASK_ZERO "as-mask-zero" Lint
        "The mask of an instance has a bit of the cull mask of some ray."
        "an instance is hit only where its mask & the cull mask of a ray is not 0"
        "give the instance a bit of the rays that shall see it, or leave it out; 0xff is seen by all"
    AS_CULL_DISABLED "as-cull-disabled" Lint
        "A ray that culls triangles by their facing meets an instance whose triangles can be culled."
        "TRIANGLE_FACING_CULL_DISABLE of an instance overrides the ray's CullBackFacing- and CullFrontFacingTriangles"
        "clear the instances' flag, or the flag of the ray"
    ANYHIT_OPAQUE "anyhit-opaque" Lint
        "An any-hit shader belongs to some geometry that is not opaque to some ray."
        "the any-hit shader of opaque geometry never runs"
        "clear the opaque flag of the geometry, or of the rays, or leave the any-hit shader out"
    AS_MOTION "as-motion" Lint
        "The rotations of an SRT motion are quaternions of length 1."
        "VkSRTDataNV: a device may normalize the quaternion that it interpolates, or take it as it is"
        "divide the quaternion by its length"
    SBT_TRIANGLES_GROUP "sbt-triangles-group" UndefinedBehavior
        "A triangle, sphere or linear swept sphere leads to a hit group without an intersection shader."
        "VUID-vkCmdTraceRaysKHR-pHitShaderBindingTable-04735"
        "the record is: instance offset + geometry index * SBT stride + SBT offset"
    SBT_PROCEDURAL_GROUP "sbt-procedural-group" UndefinedBehavior
        "A box leads to a hit group with an intersection shader, or to a null record."
        "VUID-vkCmdTraceRaysKHR-pHitShaderBindingTable-04736"
        "the record is: instance offset + geometry index * SBT stride + SBT offset"
    PIPE_MICROMAP_FLAG "pipe-micromap-flag" UndefinedBehavior
        "A pipeline that traces an acceleration structure with opacity micromaps is created for them."
        "VUID-vkCmdTraceRaysKHR-micromap-11640"
        "create the pipeline with VK_PIPELINE_CREATE_2_RAY_TRACING_OPACITY_MICROMAP_BIT_KHR"
}
