//! Rules about what must be the same in all lanes of a subgroup, or be decorated `NonUniform`.

rules! {
    NONUNIFORM_RESOURCE "nonuniform-resource" UndefinedBehavior
        "Where the lanes of a subgroup use different descriptors, the operand of the access is NonUniform."
        "Vulkan, \"Runtime SPIR-V Validation\", 10148 and 10149 (before: VUID-RuntimeSpirv-NonUniform-06274)"
        "write textures[nonuniformEXT(index)], in HLSL and Slang NonUniformResourceIndex(index); where the \
         source has it, the compiler has lost it on the way: index a texture and a sampler apart, or update \
         the compiler"
    NONUNIFORM_PLACEMENT "nonuniform-placement" UndefinedBehavior
        "NonUniform decorates the operand of the access, not only the index that it is made of."
        "Vulkan, \"Runtime SPIR-V Validation\", 10148 and 10149; GL_EXT_nonuniform_qualifier"
        "write nonuniformEXT in the brackets of the array: a variable or parameter does not keep it; where it \
         stands there, the compiler has lost it on the way, as glslang does for atomic instructions"
    PUSH_ARRAY_UNIFORM "push-array-uniform" UndefinedBehavior
        "An array in the push constants is indexed alike in all lanes."
        "Vulkan, \"Runtime SPIR-V Validation\", 04745: such indices are dynamically uniform"
        "keep tables that lanes index each for itself in a uniform or storage buffer"
    NONUNIFORM_CAPABILITY "nonuniform-capability" UndefinedBehavior
        "Where the lanes of a subgroup use different descriptors, the module declares that it does so to their kind."
        "VUID-RuntimeSpirv-None-10134 to -10147: the ArrayNonUniformIndexing capability of the kind of descriptor"
        "declare the capability, as compilers do by themselves, and enable its feature"
    HO_ARRAY_INDEX "ho-array-index" UndefinedBehavior
        "Where the lanes of a subgroup use different hit objects of an array, the index is NonUniform."
        "GL_EXT_shader_invocation_reorder: what is not uniform indexes hitObjectEXT only with nonuniformEXT"
        "write object[nonuniformEXT(index)]"
    RECORD_NONUNIFORM "record-nonuniform" UndefinedBehavior
        "A descriptor that is chosen by data of the shader record is NonUniform, as records differ between lanes."
        "Vulkan, \"Runtime SPIR-V Validation\", 10148 and 10149; a subgroup may have invocations of several records"
        "write textures[nonuniformEXT(index)], in HLSL and Slang NonUniformResourceIndex(index)"
}
