//! Rules about what must be the same in all lanes of a subgroup, or be decorated `NonUniform`.

rules! {
    NONUNIFORM_RESOURCE "nonuniform-resource" UndefinedBehavior
        "If the lanes of a subgroup use different descriptors, the operand of the access is decorated \
         NonUniform."
        "Vulkan, \"Runtime SPIR-V Validation\", 10148 and 10149 (before: VUID-RuntimeSpirv-NonUniform-06274)"
        "write textures[nonuniformEXT(index)], or NonUniformResourceIndex(index) in HLSL and Slang; if the \
         source has it, the compiler dropped it: index texture and sampler separately, or update the \
         compiler"
    NONUNIFORM_PLACEMENT "nonuniform-placement" UndefinedBehavior
        "NonUniform decorates the operand of the access, not only the index from which it is computed."
        "Vulkan, \"Runtime SPIR-V Validation\", 10148 and 10149; GL_EXT_nonuniform_qualifier"
        "write nonuniformEXT in the brackets of the array: variables and parameters do not carry it; if \
         the source has it there, the compiler dropped it, as glslang does for atomic instructions"
    PUSH_ARRAY_UNIFORM "push-array-uniform" UndefinedBehavior
        "All lanes index an array in the push constants with the same value."
        "Vulkan, \"Runtime SPIR-V Validation\", 04745: such indices must be dynamically uniform"
        "keep tables that lanes index with different values in a uniform or storage buffer"
    NONUNIFORM_CAPABILITY "nonuniform-capability" UndefinedBehavior
        "If the lanes of a subgroup use different descriptors, the module declares non-uniform indexing \
         for their kind."
        "VUID-RuntimeSpirv-None-10134 to -10147: the ArrayNonUniformIndexing capability of the kind of descriptor"
        "declare the capability, as compilers do automatically, and enable its feature"
    HO_ARRAY_INDEX "ho-array-index" UndefinedBehavior
        "If the lanes of a subgroup use different hit objects of an array, the index is decorated NonUniform."
        "GL_EXT_shader_invocation_reorder: a non-uniform index into an array of hitObjectEXT requires \
         nonuniformEXT"
        "write object[nonuniformEXT(index)]"
    RECORD_NONUNIFORM "record-nonuniform" UndefinedBehavior
        "A descriptor that is selected by shader record data is decorated NonUniform, as records differ \
         between lanes."
        "Vulkan, \"Runtime SPIR-V Validation\", 10148 and 10149; a subgroup may have invocations of several records"
        "write textures[nonuniformEXT(index)], or NonUniformResourceIndex(index) in HLSL and Slang"
}
