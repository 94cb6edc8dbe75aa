//! Rules about what the specifications leave open: `--many-seeds` draws it, and the outputs of a
//! run must not depend on the draw.

rules! {
    ANYHIT_ORDER "anyhit-order" OpenChoice
        "The outputs do not depend on the order in which any-hit shaders, or the loop of a ray query, see the hits of a ray."
        "Vulkan, \"Ray Traversal\": there is no ordering guarantee between operations on different candidates"
        "gather in the payload only what has no order (a count, a sum of integers, a minimum), or sort what \
         was gathered; blend hits one after the other by tracing on from the closest one"
    ANYHIT_DUPLICATE "anyhit-duplicate" OpenChoice
        "The outputs do not depend on how often an any-hit shader, or the loop of a ray query, sees a hit."
        "Vulkan, \"Triangle and Generated Intersection Candidates\""
        "build the geometry with VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR, or count nothing there"
    INTERSECTION_REPEAT "intersection-repeat" OpenChoice
        "The outputs do not depend on how often the intersection shader of a box runs, nor on whether it runs for a ray that misses the box by little."
        "Vulkan, \"AABB Intersection Candidates\""
        "test in the shader whether the ray hits the primitive, and leave no trace but the report"
    TIE_ORDER "tie-order" OpenChoice
        "The outputs do not depend on which of several hits at equal t is the closest."
        "Vulkan, \"Ray Closest Hit Determination\""
        "move the surfaces apart, or let the any-hit shaders choose by a number of their own"
    INVOCATION_ORDER "invocation-order" OpenChoice
        "The outputs do not depend on the order in which invocations, subgroups and workgroups run."
        "Vulkan, \"Shader Execution\": the relative order of invocations of a shader is not defined"
        "let each invocation write its own element, or combine by atomic instructions whose results nobody \
         reads; where the order of a list does not matter, allow this rule for the scene"
    LANE_DEPENDENT_RESULT "lane-dependent-result" Lint
        "The outputs do not depend on the size of subgroups, nor on which invocations form one."
        "Vulkan, \"Subgroup\": its size is the device's, and how invocations are assigned is not defined"
        "use subgroup instructions only to do faster what single invocations would do, or require a size"
    ROBUST_READ "robust-read" Lint
        "The outputs do not depend on what a robust read outside its buffer gives."
        "Vulkan, \"Robust Buffer Access\": without robustBufferAccess2 it is any value of the buffer, or 0"
        "compare the index with the length of the buffer"
    UNDEFINED_DRAWN "undefined-drawn" UndefinedValue
        "The outputs do not depend on what a variable holds that nothing was written to, nor on OpUndef."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "give the variable a value where it is declared; --sanitize tells what depends on it"
    CONTRACTION "contraction" Lint
        "The outputs do not depend on whether products are rounded before they are added."
        "SPIR-V, NoContraction: without it, operations may be contracted"
        "declare the result `precise`, or compare with a tolerance"
}
