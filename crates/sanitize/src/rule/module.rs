//! Rules about instructions and declarations that are known from a module alone.

rules! {
    UNIFORM_STORE "uniform-store" UndefinedBehavior
        "A uniform buffer is not written."
        "VUID-StandaloneSpirv-Uniform-06925"
        "write to a storage buffer, or to a copy in a local variable"
    NON_WRITABLE "non-writable" UndefinedBehavior
        "Nothing is written through a variable, parameter or member that is decorated NonWritable."
        "SPIR-V 3.20, NonWritable: the memory object or member is not writable"
        "drop `readonly` from the declaration, or do not write"
    NON_READABLE "non-readable" UndefinedBehavior
        "Nothing is read through a variable, parameter or member that is decorated NonReadable."
        "SPIR-V 3.20, NonReadable: the memory object or member is not readable"
        "drop `writeonly` from the declaration: an atomic instruction reads, too"
    BARRIER_SEMANTICS "barrier-semantics" UndefinedBehavior
        "Memory semantics specify one order and a class of memory, or neither, as the instruction allows."
        "VUID-StandaloneSpirv-MemorySemantics-10865 to -UnequalMemorySemantics-10879"
        "combine AcquireRelease with the classes of memory to order: UniformMemory, WorkgroupMemory, \
         ImageMemory"
    ATOMIC_CLASS "atomic-class" UndefinedBehavior
        "An atomic instruction accesses a buffer, an image or shared memory."
        "VUID-StandaloneSpirv-None-04686: Uniform, Workgroup, Image, StorageBuffer, PhysicalStorageBuffer or \
         TaskPayloadWorkgroupEXT"
        "no other invocation reaches a local or global variable: use plain instructions"
    LAUNCH_ORDER "launch-order" Lint
        "No loop waits for a value that another invocation writes."
        "Vulkan, Shader Invocation Ordering: invocations start in any order, and need not make progress while \
         another one loops"
        "run the producer in a separate pass, or do its work here if the value is not available yet"
    BARRIER_CLASS "barrier-class" Lint
        "The barriers of a shader include the class of the memory that it both writes and reads."
        "a barrier orders only accesses to the classes of memory in its semantics; GLSL's barrier() \
         includes only shared memory"
        "add memoryBarrierBuffer() or memoryBarrierImage() before barrier()"
    MEMORY_SCOPE "memory-scope" UndefinedBehavior
        "The stage and the memory model allow the memory scope of a barrier or atomic instruction."
        "VUID-StandaloneSpirv-None-04638, -04640, -07321, VUID-RuntimeSpirv-vulkanMemoryModel-06265, -06266"
        "use Workgroup within a compute workgroup, and ShaderCallKHR between shaders of one ray-tracing \
         call; beyond these, use Device without the Vulkan memory model, and QueueFamily with it, where \
         Device also requires the capability VulkanMemoryModelDeviceScope"
    INVOCATION_SCOPE "invocation-scope" UndefinedBehavior
        "An instruction with memory scope Invocation has Relaxed semantics: it orders nothing."
        "VUID-StandaloneSpirv-None-04641"
        "use the scope of the invocations that share the memory, such as gl_ScopeDevice"
    BITOP_WIDTH "bitop-width" Lint
        "Bits are counted, reversed, inserted and extracted only in 32-bit integers."
        "VUID-RuntimeSpirv-None-10824: without maintenance9, other widths are not allowed"
        "process the halves of a 64-bit integer separately, or convert a narrower one to 32 bits first"
    PAYLOAD_ALIASING "payload-aliasing" Lint
        "A shader with its own outgoing payload does not pass its caller's payload to a trace instead."
        "the called shaders overwrite the values that the shader is to return"
        "pass traceRayEXT the location of the rayPayloadEXT variable, and let it differ from that of \
         rayPayloadInEXT"
    ALIGNED_OPERAND "aligned-operand" UndefinedBehavior
        "The Aligned operand of each access through a physical pointer is a multiple of the size of the \
         largest scalar."
        "VUID-StandaloneSpirv-PhysicalStorageBuffer64-04708, -06314"
        "raise buffer_reference_align to the size of the largest scalar of the block"
    INTERFACE_INITIALIZER "interface-initializer" UndefinedBehavior
        "Only variables of storage class Private, Function, Output or Workgroup have an initializer."
        "VUID-StandaloneSpirv-OpVariable-04651"
        "assign to the variable at the start of the shader"
    GATHER_COMPONENT "gather-component" UndefinedBehavior
        "The component of a gather is a constant from 0 to 3."
        "SPIR-V 3.3.10, OpImageGather; VUID-StandaloneSpirv-OpImageGather-04664"
        "branch on the four components"
    RECORD_BLOCK "record-block" UndefinedBehavior
        "The shader record variable is a Block, and is only read."
        "SPV_KHR_ray_tracing, ShaderRecordBufferKHR; VUID-StandaloneSpirv-None-10684"
        "declare it with `layout(shaderRecordEXT) buffer`, and write elsewhere"
    VOLATILE_LOAD "volatile-load" UndefinedValue
        "With the Vulkan memory model, each load of a builtin that changes while a shader runs is Volatile."
        "VUID-StandaloneSpirv-VulkanMemoryModel-04679"
        "update the compiler"
    ATTR_READONLY "attr-readonly" UndefinedBehavior
        "Only intersection shaders write hit attributes."
        "VUID-StandaloneSpirv-HitAttributeKHR-04703"
        "copy them to a local variable first"
    PAYLOAD_LOCATION "payload-location" UndefinedBehavior
        "Only payloads, callable data, hit attributes and shader records have a Location, and no builtin \
         has one."
        "VUID-StandaloneSpirv-Location-04915, -06672"
        "remove the Location of the variable"
    WORKGROUP_IN_RT "workgroup-in-rt" UndefinedBehavior
        "Ray-tracing stages use no variable of storage class Workgroup: they have no workgroups."
        "VUID-StandaloneSpirv-None-04645"
        "pass data through the payload, a buffer or subgroup instructions"
    NO_REPACK_MODE "no-repack-mode" UndefinedBehavior
        "An entry point with SubgroupUniformControlFlowKHR or MaximallyReconvergesKHR traces no rays and \
         calls no shaders."
        "VUID-RuntimeSpirv-SubgroupUniformControlFlowKHR-06379; for MaximallyReconvergesKHR, 09565"
        "remove the attribute of main(): lanes are repacked at each trace, report, call and reordering"
    AS_LOAD_SOURCE "as-load-source" UndefinedBehavior
        "An acceleration structure is loaded from a descriptor, and is not OpUndef."
        "VUID-StandaloneSpirv-OpTypeAccelerationStructureKHR-11339, OpUndef-12464"
        "declare the structure as a uniform variable with a set and a binding"
    REORDER_HINT_BITS "reorder-hint-bits" Lint
        "The hint of a reordering fits in the number of bits that is passed with it, which is at most 32."
        "SPV_EXT_shader_invocation_reorder: only that number of lowest bits of the hint is used to sort \
         the invocations"
        "pass the number of bits that the hint uses; the operands are, in this order: hint, bits"
    FASTMATH_MODES "fastmath-modes" UndefinedBehavior
        "FPFastMathDefault excludes ContractionOff and SignedZeroInfNanPreserve, and AllowTransform \
         requires AllowContract and AllowReassoc."
        "SPV_KHR_float_controls2"
        "remove ContractionOff and SignedZeroInfNanPreserve, or FPFastMathDefault"
    POINTER_CONVERT "pointer-convert" UndefinedBehavior
        "Pointers are converted only to and from 64-bit integers."
        "VUID-StandaloneSpirv-PhysicalStorageBuffer64-04710; SPIR-V 3.3.11, OpConvertPtrToU: narrower ones lose bits"
        "keep addresses in uint64_t, or in uvec2"
}
