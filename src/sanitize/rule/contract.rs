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
        "let every hit and miss shader write that part, or give it a value before traceRayEXT"
    CALLABLE_UNSET_READ "callable-unset-read" UndefinedValue
        "A callable shader reads only what its caller has written to the callable data, and the caller only what either has written."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "write that part of the callable data before executeCallableEXT, or in the callable shader"
    PAYLOAD_UNDECLARED "payload-undeclared" UndefinedBehavior
        "Every hit and miss shader that a trace with a payload calls declares it, even if it does not use it."
        "Vulkan, \"Ray Tracing Pipeline Interface\": the payload \"must be declared in the shader even if it is not \
         referenced\"; VUID-RuntimeSpirv-OpTraceRayKHR-11855"
        "declare the payload with rayPayloadInEXT in the shader; where rays of several payload types call it, give them \
         one structure, or each type a hit group of its own (and an SBT offset) whose shader declares it"
    CALLABLE_UNDECLARED "callable-undeclared" UndefinedBehavior
        "Every callable shader that is called with callable data declares it, even if it does not use it."
        "Vulkan, \"Ray Tracing Pipeline Interface\": the incoming data \"must be the same structure as the callable data \
         referenced by the execute callable instruction\""
        "declare the data with callableDataInEXT in the shader"
    PAYLOAD_STRUCTURE "payload-structure" UndefinedBehavior
        "Payloads and callable data of caller and called shader are one structure, not only the same scalars."
        "Vulkan, \"Ray Tracing Pipeline Interface\": the payload \"must be the same structure for all shader stages using \
         the payload for that ray\"; VUID-RuntimeSpirv-OpTraceRayKHR-11855"
        "declare the same structure in both shaders, best in a file that both include; where rays of several payload \
         types call one shader, give them one structure, or each type a hit group of its own (and an SBT offset) whose \
         shader declares it"
    ATTR_TRIANGLE_TYPE "attr-triangle-type" UndefinedValue
        "The hit attributes of a group for triangles are two floats."
        "Vulkan, \"Ray Tracing Pipeline Interface\": barycentric coordinates"
        "declare `hitAttributeEXT vec2`; the third barycentric coordinate is 1 - x - y"
    ATTR_GROUP_TYPE "attr-group-type" UndefinedValue
        "All shaders of a hit group declare the same type of hit attributes."
        "Vulkan, \"Ray Tracing Pipeline Interface\""
        "use one declaration for all shaders of the group, as from a header"
    PAYLOAD_DECORATION "payload-decoration" UndefinedBehavior
        "A payload or callable data that is laid out by decorations is laid out alike by caller and called shader."
        "VUID-RuntimeSpirv-OpTraceRayKHR-11855; Vulkan, \"Ray Tracing Pipeline Interface\""
        "use one declaration for all shaders, as from a header"
    VOLATILE_SUBGROUP "volatile-subgroup" UndefinedValue
        "Builtins of the subgroup are decorated Volatile in shaders that can be repacked."
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
        "ask gl_HitKindEXT first, or use another hit group for other primitives"
    SPHERE_LSS_BUILTIN "sphere-lss-builtin" UndefinedValue
        "HitSphere* and HitLSS* builtins are read only where such a primitive was hit."
        "SPV_NV_linear_swept_spheres"
        "ask gl_HitIsSphereNV or gl_HitIsLSSNV first, or use another hit group for other primitives"
    ID_AS_INDEX "id-as-index" Lint
        "An array is indexed by the same id of a hit in all shaders."
        "InstanceId counts the instances of the structure, InstanceCustomIndexKHR is what the host gave them"
        "use gl_InstanceCustomIndexEXT for tables that the host fills by it, and gl_InstanceID for one entry an instance"
}
