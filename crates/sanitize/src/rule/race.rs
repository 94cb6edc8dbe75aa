//! Rules about invocations that access the same memory.

rules! {
    RACE_BUFFER "race-buffer" UndefinedBehavior
        "Two invocations that access the same bytes, at least one of which writes, are ordered."
        "Vulkan, Memory Model, Data Race"
        "let each invocation write its own element, use atomic instructions, or, within a workgroup, put \
         memoryBarrierBuffer() and a barrier() that the whole workgroup reaches between the two accesses"
    RACE_WORKGROUP "race-workgroup" UndefinedBehavior
        "Two invocations that access the same shared variable, at least one of which writes, are ordered."
        "Vulkan, Memory Model, Data Race"
        "put a barrier() that the whole workgroup reaches between the two accesses, let each invocation \
         write its own element, or use atomic instructions"
    RACE_IMAGE "race-image" UndefinedBehavior
        "Two invocations that access the same texel, at least one of which writes, are ordered."
        "Vulkan, Memory Model, Data Race"
        "let each invocation write its own texel, use imageAtomic*, or, within a workgroup, put \
         memoryBarrierImage() and barrier() between the two accesses"
    RACE_MIXED_ATOMIC "race-mixed-atomic" UndefinedBehavior
        "If one invocation accesses memory atomically, others do so too, or are ordered with it."
        "Vulkan, Memory Model, Data Race: only pairs of atomic operations are mutually ordered"
        "read with atomicOr(x, 0) or atomicLoad, write with atomicExchange or atomicStore, or initialize \
         the value in a separate dispatch"
    RACE_CALLER_CALLEE "race-caller-callee" UndefinedBehavior
        "Shaders of one ray-tracing call that access the same memory, at least one of which writes, \
         release and acquire it."
        "Vulkan, Memory Model, Shader Call Order: only a release and an acquire barrier order a caller and a callee"
        "pass the value in the payload; or declare the memory coherent, and put \
         memoryBarrier(gl_ScopeShaderCallEXT, ...) after the write (release) and before the read \
         (acquire); in any-hit shaders of one trace, which nothing orders, use atomic instructions"
    RACE_ATOMIC_WIDTH "race-atomic-width" UndefinedBehavior
        "Atomic instructions on the same memory have the same width, or are ordered."
        "Vulkan, Memory Model, Atomic Operation: only operations on the same set of locations are mutually \
         ordered"
        "use one width for all atomic instructions on a counter, or put a barrier between the two"
    RACE_ATOMIC_SCOPE "race-atomic-scope" UndefinedBehavior
        "The scope of an atomic instruction includes all invocations that access the same memory atomically."
        "Vulkan, Memory Model, Atomic Operation: only operations in each other's memory scope are mutually \
         ordered"
        "use gl_ScopeDevice, as atomicAdd(x, 1) does, if invocations of other workgroups or of the launch \
         take part"
    RACE_CROSS_REFERENCE "race-cross-reference" UndefinedBehavior
        "Memory that is written through one descriptor or device address is not accessed through another \
         in the same pass."
        "Vulkan, Memory Model, Location-Ordered: barriers in shaders order only accesses through one reference"
        "access the memory through one binding, or in another pass"
    RESTRICT_BROKEN "restrict-broken" UndefinedBehavior
        "Memory that is written through one declaration is not accessed through a `restrict` one."
        "SPIR-V 3.20, Restrict; 2.18.2, Aliasing: a compiler assumes that no other declaration reaches it"
        "drop `restrict` from both declarations, and access the memory through one binding"
    ALIAS_DEFAULT "alias-default" UndefinedBehavior
        "Memory that is written through one binding is not accessed through another, unless both are \
         decorated Aliased."
        "SPIR-V 2.18.2, Aliasing: only declarations that are decorated Aliased may reach the same memory"
        "access the memory through one binding, or bind buffers or ranges that do not overlap"
    ORDER_ASSUMED "order-assumed" UndefinedBehavior
        "Memory that one invocation writes and another accesses is made available and visible between the \
         two accesses."
        "Vulkan, Memory Model, Availability and Visibility: ordering alone does not make a write visible"
        "declare the memory coherent (workgroupcoherent, devicecoherent), or add \
         gl_SemanticsMakeAvailable and gl_SemanticsMakeVisible to the barriers"
    COHERENT_MISSING "coherent-missing" UndefinedBehavior
        "Memory through which invocations communicate is declared coherent."
        "Vulkan, Memory Model, Private vs. Non-Private: barriers in shaders do not order private accesses"
        "declare the buffer or image `coherent` (`globallycoherent` in Slang and HLSL; `@coherent var` in \
         WGSL for naga, which adds no decoration otherwise); if the source has it, the compiler dropped it"
    RACE_SAME_VALUE "race-same-value" UndefinedBehavior
        "Two invocations do not write to the same bytes, not even the same value."
        "Vulkan, Memory Model, Data Race: \"X and Y be operations that access overlapping sets of memory locations M, \
         where X != Y, and at least one of X and Y is a write, and X and Y are not mutually-ordered atomic \
         operations\"; equal values are no exception"
        "let one invocation write, give each its own element, or use an atomic instruction"
}
