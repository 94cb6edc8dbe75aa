//! Rules about the contract between shaders: payloads, callable data, hit attributes, builtins.

rules! {
    REPORT_ATTRIBUTES_UNSET "report-attributes-unset" UndefinedValue
        "Every scalar of the hit attributes is written before the report that carries it."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "write all of the hitAttributeEXT variable before reportIntersectionEXT"
    PAYLOAD_UNSET_READ "payload-unset-read" UndefinedValue
        "A hit or miss shader reads only those parts of the payload that its caller, or an any-hit shader before it, has written."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "write that part of the payload before traceRayEXT, or do not read it in the called shader"
    PAYLOAD_RESULT_UNSET "payload-result-unset" UndefinedValue
        "After a trace, its caller reads only those parts of the payload that it, or a called shader, has written."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "write that part in every hit and miss shader, or assign it before traceRayEXT"
    CALLABLE_UNSET_READ "callable-unset-read" UndefinedValue
        "A callable shader reads only what its caller has written to the callable data, and the caller only what either has written."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "write that part of the callable data before executeCallableEXT, or in the callable shader"
    PAYLOAD_UNDECLARED "payload-undeclared" UndefinedBehavior
        "Every hit and miss shader that is called by a trace with a payload declares the payload, even if \
         it does not use it."
        "Vulkan, \"Ray Tracing Pipeline Interface\": the payload \"must be declared in the shader even if it is not \
         referenced\"; VUID-RuntimeSpirv-OpTraceRayKHR-11855"
        "declare the payload with rayPayloadInEXT in the shader; if rays with different payload types call \
         it, use one structure for all of them, or a separate hit group (and SBT offset) for each type"
    CALLABLE_UNDECLARED "callable-undeclared" UndefinedBehavior
        "Every callable shader that is called with callable data declares the data, even if it does not \
         use it."
        "Vulkan, \"Ray Tracing Pipeline Interface\": the incoming data \"must be the same structure as the callable data \
         referenced by the execute callable instruction\""
        "declare the data with callableDataInEXT in the shader"
    PAYLOAD_STRUCTURE "payload-structure" UndefinedBehavior
        "Caller and called shader declare the same structure for a payload or callable data, not only the \
         same scalars."
        "Vulkan, \"Ray Tracing Pipeline Interface\": the payload \"must be the same structure for all shader stages using \
         the payload for that ray\"; VUID-RuntimeSpirv-OpTraceRayKHR-11855"
        "declare the same structure in both shaders, ideally in a shared header; if rays with different \
         payload types call one shader, use one structure for all of them, or a separate hit group (and \
         SBT offset) for each type"
    ATTR_TRIANGLE_TYPE "attr-triangle-type" UndefinedValue
        "The hit attributes of a triangle hit group are two floats."
        "Vulkan, \"Ray Tracing Pipeline Interface\": barycentric coordinates"
        "declare `hitAttributeEXT vec2`; the third barycentric coordinate is 1 - x - y"
    ATTR_GROUP_TYPE "attr-group-type" UndefinedValue
        "All shaders of a hit group declare the same type of hit attributes."
        "Vulkan, \"Ray Tracing Pipeline Interface\""
        "share one declaration between all shaders of the group, for example in a header"
    PAYLOAD_DECORATION "payload-decoration" UndefinedBehavior
        "Caller and called shader use the same layout for a payload or callable data with layout decorations."
        "VUID-RuntimeSpirv-OpTraceRayKHR-11855; Vulkan, \"Ray Tracing Pipeline Interface\""
        "share one declaration between all shaders, for example in a header"
    VOLATILE_SUBGROUP "volatile-subgroup" UndefinedValue
        "Subgroup builtins are decorated Volatile in shaders whose invocations can be repacked."
        "VUID-StandaloneSpirv-VulkanMemoryModel-04678"
        "update the compiler, or compile for SPIR-V with the Vulkan memory model"
    VOLATILE_RAYTMAX "volatile-raytmax" UndefinedValue
        "RayTmaxKHR is decorated Volatile in intersection shaders."
        "VUID-StandaloneSpirv-VulkanMemoryModel-04678"
        "update the compiler, or compile for SPIR-V with the Vulkan memory model"
    ATTR_UNSET_READ "attr-unset-read" UndefinedValue
        "A shader reads only those hit attributes that were written."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "write all of the hit attributes before the report; those of triangles are two floats"
    POSITIONS_KIND "positions-kind" UndefinedValue
        "HitTriangleVertexPositionsKHR is read only where a triangle was hit."
        "VUID-HitTriangleVertexPositionsKHR-HitTriangleVertexPositionsKHR-08750"
        "test gl_HitKindEXT first, or use a separate hit group for other primitives"
    SPHERE_LSS_BUILTIN "sphere-lss-builtin" UndefinedValue
        "HitSphere* and HitLSS* builtins are read only where such a primitive was hit."
        "SPV_NV_linear_swept_spheres"
        "test gl_HitIsSphereNV or gl_HitIsLSSNV first, or use a separate hit group for other primitives"
    ID_AS_INDEX "id-as-index" Lint
        "All shaders index an array with the same id of a hit."
        "InstanceId is the index of the instance in the structure; InstanceCustomIndexKHR is the value \
         that the host set"
        "use gl_InstanceCustomIndexEXT for tables that the host fills by custom index, and gl_InstanceID \
         for tables with one entry per instance"
}
