//! Rules about invocations that access the same memory.

rules! {
    RACE_BUFFER "race-buffer" UndefinedBehavior
        "Of two invocations that access the same bytes, one of which writes, one is ordered behind the other."
        "Vulkan, Memory Model, Data Race"
        "let each invocation write its own element, use atomic instructions, or put a barrier between the \
         two: barrier() alone orders shared variables, and buffers only with memoryBarrierBuffer(); no \
         barrier orders different workgroups or the invocations of a launch"
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
    RACE_SAME_VALUE "race-same-value" Lint
        "Two invocations do not write to the same bytes, not even the same value."
        "Vulkan, Memory Model, Data Race: it makes no difference which values are written"
        "let one of the invocations write: if (gl_LocalInvocationIndex == 0)"
}
