//! Rules about what the specifications leave open: `--many-seeds` draws it, and the outputs of a
//! run must not depend on the draw.

rules! {
    ANYHIT_ORDER "anyhit-order" OpenChoice
        "The outputs do not depend on the order in which any-hit shaders, or the loop of a ray query, see the hits of a ray."
        "Vulkan, \"Ray Traversal\": there is no ordering guarantee between operations on different candidates"
        "accumulate only order-independent values in the payload (a count, a sum of integers, a minimum), \
         or sort the gathered values; to blend hits in order, trace again from the closest hit"
    ANYHIT_DUPLICATE "anyhit-duplicate" OpenChoice
        "The outputs do not depend on how often an any-hit shader, or the loop of a ray query, sees a hit."
        "Vulkan, \"Triangle and Generated Intersection Candidates\""
        "build the geometry with VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR, or do not count hits"
    INTERSECTION_REPEAT "intersection-repeat" OpenChoice
        "The outputs do not depend on how often the intersection shader of a box runs, or on whether it \
         runs for a ray that narrowly misses the box."
        "Vulkan, \"AABB Intersection Candidates\""
        "test in the shader whether the ray hits the primitive, and have no side effects except the report"
    TIE_ORDER "tie-order" OpenChoice
        "The outputs do not depend on which of several hits at equal t is the closest."
        "Vulkan, \"Ray Closest Hit Determination\""
        "move the surfaces apart, or let the any-hit shaders choose by an explicit priority"
    INVOCATION_ORDER "invocation-order" OpenChoice
        "The outputs do not depend on the order in which invocations, subgroups and workgroups run."
        "Vulkan, \"Shader Execution\": the relative order of invocations of a shader is not defined"
        "let each invocation write its own element, or combine values with atomic instructions whose \
         results are not read; if the order of a list does not matter, allow this rule for the scene"
    LANE_DEPENDENT_RESULT "lane-dependent-result" Lint
        "The outputs do not depend on the size of subgroups, or on which invocations form a subgroup."
        "Vulkan, \"Subgroup\": its size depends on the device, and the assignment of invocations is not \
         defined"
        "use subgroup instructions only to speed up what single invocations would compute, or require a size"
    ROBUST_READ "robust-read" Lint
        "The outputs do not depend on the value that a robust read outside its buffer returns."
        "Vulkan, \"Robust Buffer Access\": without robustBufferAccess2 it is any value of the buffer, or 0"
        "compare the index with the length of the buffer"
    UNDEFINED_DRAWN "undefined-drawn" UndefinedValue
        "The outputs do not depend on the contents of an unwritten variable, or on OpUndef."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "initialize the variable where it is declared; --sanitize reports what depends on it"
    UNDEFINED_RESULT "undefined-result" UndefinedValue
        "The outputs do not depend on the result of an operation whose operands make it undefined."
        "SPIR-V and GLSL.std.450, for each instruction: the resulting value is undefined"
        "restrict the operands to the domain of the operation; --sanitize reports each violation"
    WORKGROUP_DRAWN "workgroup-drawn" UndefinedValue
        "The outputs do not depend on the contents of unwritten workgroup memory."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "write the memory and wait at a barrier before reading it"
    ROBUST_TEXEL "robust-texel" Lint
        "The outputs do not depend on the value that a robust read outside its image or texel buffer returns."
        "Vulkan, robustImageAccess: (0, 0, 0) and an alpha of 0 or 1; robustBufferAccess for texel buffers"
        "compare the coordinates with the size of the image, or clamp them"
    CONTRACTION "contraction" Lint
        "The outputs do not depend on whether products are rounded before they are added."
        "SPIR-V, NoContraction: without it, operations may be contracted"
        "declare the result `precise`, or compare with a tolerance"
    DOT_ORDER "dot-order" Lint
        "The outputs do not depend on the order in which dot and matrix products are summed, or on how \
         often they are rounded."
        "Vulkan, \"Precision of Individual Operations\": formulas may be transformed by associativity"
        "write the sum by hand and declare it `precise`, or compare with a tolerance"
    REASSOCIATION "reassociation" Lint
        "The outputs do not depend on the order in which the terms of a sum are added, or the factors of a product multiplied."
        "SPIR-V, NoContraction and AllowReassoc: without NoContraction, operations may be reassociated"
        "declare the result `precise`, or compare with a tolerance"
    DIVISION_ROUNDING "division-rounding" Lint
        "The outputs do not depend on how quotients are rounded."
        "Vulkan, \"Precision of Individual Operations\": OpFDiv is exact to 2.5 ULP; SPIR-V, AllowRecip"
        "do not expect a quotient to be a whole number: round it, or divide integers"
    FUNCTION_PRECISION "function-precision" Lint
        "The outputs do not depend on the precision of elementary functions."
        "Vulkan, \"Precision of Individual Operations\": a table of ULPs and absolute errors"
        "allow for the error where a result decides a branch: clamp it, or compare with a tolerance"
    ZERO_SIGN "zero-sign" Lint
        "The outputs do not depend on the sign of a zero."
        "SPIR-V 3.15, NSZ: the sign of a zero may be ignored, as it may without SignedZeroInfNanPreserve"
        "test for 0 before dividing by it, or use the sign of another value"
    DENORMAL_FLUSH "denormal-flush" Lint
        "The outputs do not depend on whether denormal numbers are flushed to zero."
        "Vulkan, \"Floating-Point Computation\": without DenormPreserve, denormal values may be flushed"
        "compare with the smallest normal number instead of 0, or scale the numbers"
}
