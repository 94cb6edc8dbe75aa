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
        "Memory semantics have one order and a class of memory, or neither, as their instruction allows."
        "VUID-StandaloneSpirv-MemorySemantics-10865 to -UnequalMemorySemantics-10879"
        "use AcquireRelease together with the classes of memory that are ordered: UniformMemory, WorkgroupMemory, \
         ImageMemory"
    ATOMIC_CLASS "atomic-class" UndefinedBehavior
        "An atomic instruction accesses a buffer, an image or shared memory."
        "VUID-StandaloneSpirv-None-04686: Uniform, Workgroup, Image, StorageBuffer, PhysicalStorageBuffer or \
         TaskPayloadWorkgroupEXT"
        "no other invocation reaches a local or global variable: use plain instructions"
    LAUNCH_ORDER "launch-order" Lint
        "No loop waits for what another invocation writes."
        "Vulkan, Shader Invocation Ordering: invocations start in any order, and need not make progress while \
         another one loops"
        "let the producer be a pass of its own; or do the work here where the value is not there yet"
    BARRIER_CLASS "barrier-class" Lint
        "The barriers of a shader name the class of the memory that it both writes and reads."
        "a barrier orders only accesses to the classes of memory that its semantics name; GLSL's barrier() names \
         shared memory alone"
        "add memoryBarrierBuffer() or memoryBarrierImage() before barrier()"
    MEMORY_SCOPE "memory-scope" UndefinedBehavior
        "The memory scope of a barrier or atomic instruction is one that the stage and the memory model have."
        "VUID-StandaloneSpirv-None-04638, -04640, -07321, VUID-RuntimeSpirv-vulkanMemoryModel-06265, -06266"
        "use Workgroup within a workgroup of compute shaders, ShaderCallKHR between shaders of one ray-tracing call; \
         beyond these, Device without the Vulkan memory model, and QueueFamily with it, as Device needs the \
         capability VulkanMemoryModelDeviceScope, too"
    INVOCATION_SCOPE "invocation-scope" UndefinedBehavior
        "An instruction of memory scope Invocation orders nothing: its semantics are Relaxed."
        "VUID-StandaloneSpirv-None-04641"
        "use the scope of the invocations that share the memory, as gl_ScopeDevice"
    BITOP_WIDTH "bitop-width" Lint
        "Bits are counted, reversed, inserted and extracted of 32-bit integers alone."
        "VUID-RuntimeSpirv-None-10824: without maintenance9, other widths are not allowed"
        "treat the halves of a 64-bit integer by themselves, or convert a narrow one to 32 bits first"
    PAYLOAD_ALIASING "payload-aliasing" Lint
        "A shader that has a payload of its own does not pass that of its caller to a trace in its place."
        "the called shaders overwrite what the shader was to return"
        "give traceRayEXT the location of the rayPayloadEXT variable, another than that of rayPayloadInEXT"
    ALIGNED_OPERAND "aligned-operand" UndefinedBehavior
        "Each access through a physical pointer names an alignment that is a multiple of the largest scalar."
        "VUID-StandaloneSpirv-PhysicalStorageBuffer64-04708, -06314"
        "raise buffer_reference_align to the size of the largest scalar of the block"
    INTERFACE_INITIALIZER "interface-initializer" UndefinedBehavior
        "Only variables of storage class Private, Function, Output or Workgroup have an initializer."
        "VUID-StandaloneSpirv-OpVariable-04651"
        "assign to the variable at the start of the shader"
    GATHER_COMPONENT "gather-component" UndefinedBehavior
        "The component of a gather is a constant from 0 to 3."
        "SPIR-V 3.3.10, OpImageGather; VUID-StandaloneSpirv-OpImageGather-04664"
        "branch over the four components"
    RECORD_BLOCK "record-block" UndefinedBehavior
        "The variable of the shader record is a Block, and is only read."
        "SPV_KHR_ray_tracing, ShaderRecordBufferKHR; VUID-StandaloneSpirv-None-10684"
        "declare it with `layout(shaderRecordEXT) buffer`, and write elsewhere"
    VOLATILE_LOAD "volatile-load" UndefinedValue
        "With the Vulkan memory model, each load of a builtin that changes while a shader runs is Volatile."
        "VUID-StandaloneSpirv-VulkanMemoryModel-04679"
        "update the compiler"
    ATTR_READONLY "attr-readonly" UndefinedBehavior
        "Hit attributes are written by intersection shaders alone."
        "VUID-StandaloneSpirv-HitAttributeKHR-04703"
        "copy them to a local variable first"
    PAYLOAD_LOCATION "payload-location" UndefinedBehavior
        "Location stands on payloads, callable data, attributes and records, and on no builtin."
        "VUID-StandaloneSpirv-Location-04915, -06672"
        "drop the Location of the variable"
    WORKGROUP_IN_RT "workgroup-in-rt" UndefinedBehavior
        "Ray-tracing stages use no variable of storage class Workgroup: they have no workgroups."
        "VUID-StandaloneSpirv-None-04645"
        "pass data through the payload, a buffer or subgroup instructions"
    NO_REPACK_MODE "no-repack-mode" UndefinedBehavior
        "An entry point that reconverges as its source says traces no rays and calls no shader."
        "VUID-RuntimeSpirv-SubgroupUniformControlFlowKHR-06379; of MaximallyReconvergesKHR, 09565"
        "drop the attribute of main(): lanes are repacked at each trace, report, call and reordering"
    AS_LOAD_SOURCE "as-load-source" UndefinedBehavior
        "An acceleration structure is loaded from a descriptor, and is not OpUndef."
        "VUID-StandaloneSpirv-OpTypeAccelerationStructureKHR-11339, OpUndef-12464"
        "declare the structure as a uniform variable with a set and a binding"
    REORDER_HINT_BITS "reorder-hint-bits" Lint
        "A reordering's hint has no bits above the number of bits that is given with it, which is at most 32."
        "SPV_EXT_shader_invocation_reorder: only the lowest bits of the hint, as many as are given, sort the invocations"
        "give as many bits as the hint has; the operands are, in this order: hint, bits"
    FASTMATH_MODES "fastmath-modes" UndefinedBehavior
        "FPFastMathDefault stands alone, and AllowTransform together with AllowContract and AllowReassoc."
        "SPV_KHR_float_controls2"
        "drop ContractionOff and SignedZeroInfNanPreserve, or FPFastMathDefault"
    POINTER_CONVERT "pointer-convert" UndefinedBehavior
        "A pointer is converted to and from integers of 64 bits alone."
        "VUID-StandaloneSpirv-PhysicalStorageBuffer64-04710; SPIR-V 3.3.11, OpConvertPtrToU: narrower ones lose bits"
        "keep addresses in uint64_t, or in uvec2"
}
