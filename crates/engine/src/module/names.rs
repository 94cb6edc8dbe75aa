//! The specification's names of opcodes and enumerants.

use std::borrow::Cow;

use rspirv::grammar::{self, OperandKind as Kind};

use crate::module::validate;

/// The name of a capability (`RayTracingKHR`), or `capability 1234`.
pub fn capability_name(number: u32) -> Cow<'static, str> {
    validate::capability_name(number)
}

/// The name of a storage class (`StorageBuffer`), or `storage class 1234`.
pub fn storage_class_name(number: u32) -> Cow<'static, str> {
    name_or_number("storage class", Kind::StorageClass, number)
}

/// The name of a builtin (`HitTNV`), or `builtin 1234`.
pub fn builtin_name(number: u32) -> Cow<'static, str> {
    name_or_number("builtin", Kind::BuiltIn, number)
}

/// The name of a decoration (`DescriptorSet`), or `decoration 1234`.
pub fn decoration_name(number: u32) -> Cow<'static, str> {
    name_or_number("decoration", Kind::Decoration, number)
}

/// The name of an execution mode (`LocalSize`), or `execution mode 1234`.
pub fn execution_mode_name(number: u32) -> Cow<'static, str> {
    name_or_number("execution mode", Kind::ExecutionMode, number)
}

/// The name of an addressing model (`Logical`), or `addressing model 1234`.
pub fn addressing_model_name(number: u32) -> Cow<'static, str> {
    name_or_number("addressing model", Kind::AddressingModel, number)
}

/// The name of a memory model (`GLSL450`), or `memory model 1234`.
pub fn memory_model_name(number: u32) -> Cow<'static, str> {
    name_or_number("memory model", Kind::MemoryModel, number)
}

/// The name of an instruction of an extended set (`GLSL.std.450`, 13: `Sin`), or
/// `instruction 1234 of NAME`.
pub fn ext_inst_name(set: &str, number: u32) -> Cow<'static, str> {
    let known = match set {
        "GLSL.std.450" => grammar::GLSL_STD_450_INSTRUCTION_TABLE.lookup_opcode(number),
        "OpenCL.std" => grammar::OPENCL_STD_100_INSTRUCTION_TABLE.lookup_opcode(number),
        "OpenCL.DebugInfo.100" => grammar::OPENCL_DEBUGINFO_100_INSTRUCTION_TABLE.lookup_opcode(number),
        "NonSemantic.DebugPrintf" => grammar::NONSEMANTIC_DEBUGPRINTF_INSTRUCTION_TABLE.lookup_opcode(number),
        "NonSemantic.DebugBreak" => grammar::NONSEMANTIC_DEBUGBREAK_INSTRUCTION_TABLE.lookup_opcode(number),
        _ if set.starts_with("NonSemantic.Shader.DebugInfo.") => {
            grammar::NONSEMANTIC_SHADER_DEBUGINFO_100_INSTRUCTION_TABLE.lookup_opcode(number)
        }
        _ => None,
    };
    match known {
        Some(instruction) => instruction.opname.into(),
        None => format!("instruction {number} of {set}").into(),
    }
}

fn name_or_number(what: &str, kind: Kind, number: u32) -> Cow<'static, str> {
    validate::enumerant_name(kind, number).unwrap_or_else(|| format!("{what} {number}").into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_numbers_have_names_and_others_say_what_they_are() {
        assert_eq!(capability_name(4479), "RayTracingKHR");
        assert_eq!(capability_name(6032), "RayTracingOpacityMicromapExecutionModeKHR");
        assert_eq!(capability_name(60000), "capability 60000");
        assert_eq!(storage_class_name(5342), "IncomingRayPayloadKHR");
        assert_eq!(builtin_name(5319), "LaunchIdKHR");
        assert_eq!(decoration_name(34), "DescriptorSet");
        assert_eq!(execution_mode_name(17), "LocalSize");
        assert_eq!(memory_model_name(1), "GLSL450");
        assert_eq!(addressing_model_name(5348), "PhysicalStorageBuffer64");
        assert_eq!(ext_inst_name("GLSL.std.450", 13), "Sin");
        assert_eq!(ext_inst_name("NonSemantic.Shader.DebugInfo.102", 103), "DebugLine");
        assert_eq!(ext_inst_name("Some.Set", 3), "instruction 3 of Some.Set");
    }
}
