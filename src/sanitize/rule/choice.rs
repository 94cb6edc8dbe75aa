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
    UNDEFINED_RESULT "undefined-result" UndefinedValue
        "The outputs do not depend on what an operation gives whose operands leave its result undefined."
        "SPIR-V and GLSL.std.450, of each instruction: the resulting value is undefined"
        "keep the operands where the result is defined; --sanitize tells each that is not"
    WORKGROUP_DRAWN "workgroup-drawn" UndefinedValue
        "The outputs do not depend on what the memory of a workgroup holds that nobody wrote."
        "SPIR-V 3.3.8, OpVariable: without an initializer, its contents are undefined"
        "let the invocations write it and wait at a barrier before it is read"
    ROBUST_TEXEL "robust-texel" Lint
        "The outputs do not depend on what a robust read outside its image or texel buffer gives."
        "Vulkan, robustImageAccess: (0, 0, 0) and an alpha of 0 or 1; robustBufferAccess for texel buffers"
        "compare the coordinates with the size of the image, or clamp them"
    CONTRACTION "contraction" Lint
        "The outputs do not depend on whether products are rounded before they are added."
        "SPIR-V, NoContraction: without it, operations may be contracted"
        "declare the result `precise`, or compare with a tolerance"
    DOT_ORDER "dot-order" Lint
        "The outputs do not depend on the order in which dot and matrix products are added up, nor on how often they are rounded."
        "Vulkan, \"Precision of Individual Operations\": formulas may be transformed by associativity"
        "write the sum by hand and declare it `precise`, or compare with a tolerance"
    REASSOCIATION "reassociation" Lint
        "The outputs do not depend on the order in which the terms of a sum are added, or the factors of a product multiplied."
        "SPIR-V, NoContraction and AllowReassoc: without the former operations may be reassociated"
        "declare the result `precise`, or compare with a tolerance"
    DIVISION_ROUNDING "division-rounding" Lint
        "The outputs do not depend on how quotients are rounded."
        "Vulkan, \"Precision of Individual Operations\": OpFDiv is exact to 2.5 ULP; SPIR-V, AllowRecip"
        "do not expect whole numbers of a quotient: round it, or divide integers"
    FUNCTION_PRECISION "function-precision" Lint
        "The outputs do not depend on how exact elementary functions are."
        "Vulkan, \"Precision of Individual Operations\": a table of ULPs and absolute errors"
        "leave room for the error where a result decides: clamp it, or compare with a tolerance"
    ZERO_SIGN "zero-sign" Lint
        "The outputs do not depend on the sign of a zero."
        "SPIR-V 3.15, NSZ: the sign of a zero may be ignored; so it may without SignedZeroInfNanPreserve"
        "test for 0 before dividing by it, or take the sign of something else"
    DENORMAL_FLUSH "denormal-flush" Lint
        "The outputs do not depend on whether denormal numbers are flushed to zero."
        "Vulkan, \"Floating-Point Computation\": without DenormPreserve, denormal values may be flushed"
        "compare with the least normal number instead of 0, or scale the numbers"
}
