//! Rules about invocations that access the same memory.

rules! {
    RACE_BUFFER "race-buffer" UndefinedBehavior
        "Of two invocations that access the same bytes, one of which writes, one is ordered behind the other."
        "Vulkan, Memory Model, Data Race"
        "let each invocation write its own element, use atomic instructions, or, within a workgroup, put \
         memoryBarrierBuffer() and a barrier() that all of it reaches between the two"
    RACE_WORKGROUP "race-workgroup" UndefinedBehavior
        "Of two invocations that access the same shared variable, one of which writes, one is ordered behind the other."
        "Vulkan, Memory Model, Data Race"
        "put a barrier() that the whole workgroup reaches between the two, let each invocation write its own element, \
         or use atomic instructions"
    RACE_IMAGE "race-image" UndefinedBehavior
        "Of two invocations that access the same texel, one of which writes, one is ordered behind the other."
        "Vulkan, Memory Model, Data Race"
        "let each invocation write its own texel, use imageAtomic*, or put memoryBarrierImage() and barrier() \
         between the two, where they are of one workgroup"
    RACE_MIXED_ATOMIC "race-mixed-atomic" UndefinedBehavior
        "Where one invocation accesses memory atomically, others do so, too, or are ordered with it."
        "Vulkan, Memory Model, Data Race: only pairs of atomic operations are mutually ordered"
        "read with atomicOr(x, 0) or atomicLoad, write with atomicExchange or atomicStore, or set the \
         value up in a dispatch of its own"
    RACE_CALLER_CALLEE "race-caller-callee" UndefinedBehavior
        "Shaders of one ray-tracing call that access the same memory, one of which writes, release and acquire it."
        "Vulkan, Memory Model, Shader Call Order: only a release and an acquire barrier order a caller and a callee"
        "pass the value in the payload; or declare the memory coherent, and put \
         memoryBarrier(gl_ScopeShaderCallEXT, ...) behind the write, to release, and before the read, to \
         acquire; nothing orders the any-hit shaders of one trace: use atomic instructions"
    RACE_ATOMIC_WIDTH "race-atomic-width" UndefinedBehavior
        "Atomic instructions on the same memory have the same width, or are ordered."
        "Vulkan, Memory Model, Atomic Operation: mutually ordered are those that access the same set of locations"
        "use one width for all atomic instructions on a counter, or put a barrier between the two"
    RACE_ATOMIC_SCOPE "race-atomic-scope" UndefinedBehavior
        "The scope of an atomic instruction holds all invocations that access the same memory atomically."
        "Vulkan, Memory Model, Atomic Operation: mutually ordered are those in each other's memory scope"
        "use gl_ScopeDevice, as atomicAdd(x, 1) does, where invocations of other workgroups or of the launch \
         take part"
    RACE_CROSS_REFERENCE "race-cross-reference" UndefinedBehavior
        "What is written through one descriptor or device address is not accessed through another one in the \
         same pass."
        "Vulkan, Memory Model, Location-Ordered: barriers of shaders order accesses through one reference"
        "access the memory through one binding, or in another pass"
    RESTRICT_BROKEN "restrict-broken" UndefinedBehavior
        "Memory that is written through one declaration is not accessed through a `restrict` one."
        "SPIR-V 3.20, Restrict; 2.18.2, Aliasing: a compiler assumes that no other declaration reaches it"
        "drop `restrict` from both declarations, and access the memory through one binding"
    ALIAS_DEFAULT "alias-default" UndefinedBehavior
        "Memory that is written through one binding is not accessed through another one, unless both are Aliased."
        "SPIR-V 2.18.2, Aliasing: only declarations that are decorated Aliased may reach the same memory"
        "access the memory through one binding; or bind buffers or ranges that do not overlap"
    ORDER_ASSUMED "order-assumed" UndefinedBehavior
        "What one invocation writes and another one accesses is made available, and visible, by the two."
        "Vulkan, Memory Model, Availability and Visibility: order alone does not make a write seen"
        "declare the memory coherent (workgroupcoherent, devicecoherent), or add \
         gl_SemanticsMakeAvailable and gl_SemanticsMakeVisible to the barriers"
    COHERENT_MISSING "coherent-missing" UndefinedBehavior
        "Memory by which invocations communicate is declared coherent."
        "Vulkan, Memory Model, Private vs. Non-Private: barriers of shaders do not order private accesses"
        "declare the buffer or image `coherent` (in Slang and HLSL `globallycoherent`; WGSL for naga \
         `@coherent var`, as it decorates nothing by itself); where the source says so, the compiler has \
         lost it on the way"
    RACE_SAME_VALUE "race-same-value" UndefinedBehavior
        "Two invocations do not write to the same bytes, not even the same value."
        "Vulkan, Memory Model, Data Race: \"X and Y be operations that access overlapping sets of memory locations M, \
         where X != Y, and at least one of X and Y is a write, and X and Y are not mutually-ordered atomic \
         operations\"; equal values are no exception"
        "let one invocation write, give each its own element, or use an atomic instruction"
}
