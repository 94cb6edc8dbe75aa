//! Which complaints of SPIRV-Tools are about what `Module::validate` judges.

/// A class of complaints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Complaint {
    /// A capability, an extension or a version that is not declared.
    Declaration,
    /// A layout of a struct, an array or a matrix.
    Layout,
}

/// Parts of complaints about declarations.
const DECLARATION: &[&str] = &[
    "requires one of these capabilities",
    "requires one of these extensions",
    "one of the following extensions",
    "requires SPIR-V version",
    "is not allowed by Vulkan",
    "cannot be declared without SPV_KHR_non_semantic_info",
    // Types.
    "integer type requires the Int",
    "type requires the Float",
    "requires the Vector16 capability",
    "is required when using",
    "requires an additional capability",
    "Cannot allocate a variable containing a",
    "attempting to create memory for an illegal type, OpTypeRuntimeArray",
    "CooperativeMatrixKHR be declared",
    "CooperativeMatrixEXT be declared",
    "BFloat16DotProductKHR be declared",
    // Values of 8 and 16 bits.
    "8- or 16-bit",
    "matrices of 16-bit floats",
    // Pointers.
    "requires capability VariablePointers",
    "requires VariablePointers capability",
    "a variable pointers capability",
    "must use VariablePointers",
    // Images.
    "is required to access storage image",
    "is required to access storage ",
    "is required to read storage image",
    "is required to write to storage image",
    // Atomics, scopes, semantics.
    "64-bit atomics require the Int64Atomics",
    "atomics require the AtomicFloat",
    "requires capability VulkanMemoryModelKHR",
    "requires the VulkanMemoryModelDeviceScopeKHR capability",
    "requires capability Shader",
    "VulkanMemoryModel capability must also be declared",
    // Operations on constants, extended instructions.
    "requires Kernel capability",
    "requires Shader capability",
    "requires capability InterpolationFunction",
];

/// Parts of complaints about layouts.
const LAYOUT: &[&str] =
    &[" layout rules", "explicitly laid out", "OpTypeRuntimeArray-04680", "OpTypeBool is stored"];

/// The class of a complaint; `None` where `Module::validate` leaves the rule to others.
pub fn class_of(message: &str) -> Option<Complaint> {
    let has = |parts: &[&str]| parts.iter().any(|part| message.contains(part));
    if has(DECLARATION) {
        return Some(Complaint::Declaration);
    }
    has(LAYOUT).then_some(Complaint::Layout)
}

/// The version of SPIRV-Tools, as it prints it.
pub fn tools_version() -> String {
    // SAFETY: the function takes nothing and returns a string that lives as long as the program.
    unsafe extern "C" {
        fn spvSoftwareVersionDetailsString() -> *const std::ffi::c_char;
    }
    let text = unsafe { std::ffi::CStr::from_ptr(spvSoftwareVersionDetailsString()) };
    text.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complaints_have_their_class() {
        let missing = "Operand 2 of Decorate requires one of these capabilities: ShaderNonUniform ";
        assert_eq!(class_of(missing), Some(Complaint::Declaration));
        let other =
            "VulkanMemoryModelKHR capability must only be specified if the VulkanKHR memory model is used";
        assert_eq!(class_of(other), None);
        assert!(tools_version().contains("SPIRV-Tools"), "{}", tools_version());
    }
}
