//! Undeclared capabilities, extensions and versions: what is reported, where, and what is not.

use pretty_assertions::assert_eq;
use rspirv::spirv::Capability as C;

use crate::module::assemble::Assembler;
use crate::module::validate::grammar_delta::OPCODES;
use crate::module::validate::{ValidationClass, ValidationFinding};
use crate::module::{Module, Opcode};
use anyhit_base::error::ErrorKind;

/// A module of a minor version that declares capabilities and extensions.
fn declaring(minor: u32, capabilities: &[C], extensions: &[&str]) -> Assembler {
    let mut a = Assembler::bare(1000);
    a.words[1] = 0x0001_0000 | minor << 8;
    for capability in capabilities {
        a.op(Opcode::Capability, &[*capability as u32]);
    }
    for extension in extensions {
        a.with_string(Opcode::Extension, &[], extension, &[]);
    }
    a.op(Opcode::MemoryModel, &[0, 1]);
    a
}

/// A module of version 1.6 with `Shader` and other capabilities.
fn shader(capabilities: &[C]) -> Assembler {
    declaring(6, &[&[C::Shader], capabilities].concat(), &[])
}

fn findings(a: &Assembler) -> Vec<ValidationFinding> {
    a.loaded().validate()
}

/// Class, place, id and message of each finding.
#[track_caller]
fn found(a: &Assembler, expected: &[(ValidationClass, usize, Option<u32>, &str)]) {
    let all = findings(a);
    let all: Vec<_> = all.iter().map(|one| (one.class, one.word, one.id, one.message.as_str())).collect();
    assert_eq!(all, expected);
}

#[test]
fn a_width_of_numbers_needs_its_capability() {
    let mut a = shader(&[]);
    let at = a.op(Opcode::TypeFloat, &[20, 64]);
    let message = "OpTypeFloat of 64 bits requires the capability Float64, which the module does not declare";
    found(&a, &[(ValidationClass::Capability, at, Some(20), message)]);
    let [finding] = &findings(&a)[..] else { panic!("one finding") };
    assert_eq!(finding.fix, "declare `OpCapability Float64`");
    assert_eq!(finding.rule, "SPIR-V 2.16.1, Universal Validation Rules");
    let error = finding.error();
    assert_eq!(error.kind(), ErrorKind::InvalidModule);
    assert!(error.render().contains("= help: declare `OpCapability Float64`"), "{error:?}");

    let mut a = shader(&[C::Float64]);
    a.op(Opcode::TypeFloat, &[20, 64]);
    found(&a, &[]);
}

/// SPIR-V 3.31, Capability: `Int64Atomics` implicitly declares `Int64`, `Shader` declares `Matrix`.
#[test]
fn a_capability_declares_what_it_implies() {
    let mut a = declaring(6, &[C::Shader, C::Int64Atomics], &[]);
    a.op(Opcode::TypeInt, &[20, 64, 0]);
    found(&a, &[]);
    // VariablePointers implies VariablePointersStorageBuffer, which implies Shader.
    let mut a = declaring(6, &[C::VariablePointers], &[]);
    a.types();
    a.op(Opcode::TypeMatrix, &[20, 7, 3]);
    found(&a, &[]);
}

#[test]
fn a_capability_of_an_extension_needs_it() {
    let mut a = declaring(6, &[C::Shader, C::RayQueryKHR], &[]);
    a.op(Opcode::TypeRayQueryKHR, &[20]);
    let message = "Capability RayQueryKHR requires the extension SPV_KHR_ray_query, which the module does not \
                   declare";
    // The header has 5 words, `OpCapability Shader` two.
    found(&a, &[(ValidationClass::Extension, 8, None, message)]);
    assert_eq!(findings(&a)[0].fix, "declare `OpExtension \"SPV_KHR_ray_query\"`");
    let mut a = declaring(6, &[C::Shader, C::RayQueryKHR], &["SPV_KHR_ray_query"]);
    a.op(Opcode::TypeRayQueryKHR, &[20]);
    found(&a, &[]);
}

#[test]
fn instructions_and_storage_classes_need_one_of_their_capabilities() {
    let mut a = shader(&[]);
    a.types();
    let pointer = a.op(Opcode::TypePointer, &[20, 5342, 6]);
    let query = a.op(Opcode::TypeRayQueryKHR, &[21]);
    let payload = "StorageClass IncomingRayPayloadKHR requires one of the capabilities RayTracingNV or \
                   RayTracingKHR, none of which the module declares";
    let query_type =
        "OpTypeRayQueryKHR requires the capability RayQueryKHR, which the module does not declare";
    found(
        &a,
        &[
            (ValidationClass::Capability, pointer + 2, Some(20), payload),
            (ValidationClass::Capability, query, Some(21), query_type),
        ],
    );
    assert_eq!(findings(&a)[0].fix, "declare `OpCapability RayTracingKHR`");
    let mut a = declaring(6, &[C::RayTracingKHR], &["SPV_KHR_ray_tracing"]);
    a.types();
    a.op(Opcode::TypePointer, &[20, 5342, 6]);
    found(&a, &[]);
}

#[test]
fn a_builtin_is_reported_at_its_decoration() {
    let mut a = declaring(6, &[C::RayTracingKHR], &["SPV_KHR_ray_tracing"]);
    let at = a.op(Opcode::Decorate, &[20, 11, 5334]);
    a.types();
    a.op(Opcode::TypePointer, &[21, 1, 6]);
    a.op(Opcode::Variable, &[21, 20, 1]);
    let message = "BuiltIn CurrentRayTimeNV requires the capability RayTracingMotionBlurNV, which the module \
                   does not declare";
    found(&a, &[(ValidationClass::Capability, at + 3, Some(20), message)]);
}

/// SPIR-V, 3.7: `StorageBuffer` came with version 1.3; before, SPV_KHR_storage_buffer_storage_class
/// has it.
#[test]
fn an_extension_is_needed_below_the_version_that_took_it_in() {
    let of = |minor, extensions: &[&str]| {
        let mut a = declaring(minor, &[C::Shader], extensions);
        a.types();
        a.op(Opcode::TypePointer, &[20, 12, 6]);
        findings(&a).iter().map(|one| (one.class, one.fix.clone())).collect::<Vec<_>>()
    };
    let name = "SPV_KHR_storage_buffer_storage_class";
    let fix = format!("declare `OpExtension \"{name}\"` or compile for SPIR-V 1.3");
    assert_eq!(of(2, &[]), [(ValidationClass::Extension, fix)]);
    assert_eq!(of(2, &[name]), []);
    assert_eq!(of(3, &[]), []);
}

/// SPIR-V, 3.20: `BufferBlock` is "Missing after version 1.3".
#[test]
fn a_name_ends_with_its_last_version() {
    let of = |minor| {
        let mut a = declaring(minor, &[C::Shader], &["SPV_KHR_storage_buffer_storage_class"]);
        a.op(Opcode::Decorate, &[20, 3]);
        a.types();
        a.op(Opcode::TypeStruct, &[20, 6]);
        findings(&a).len()
    };
    assert_eq!((of(3), of(4)), (0, 1));
}

#[test]
fn each_bit_of_a_mask_has_its_requirement() {
    let mut a = shader(&[]);
    a.types();
    a.op(Opcode::TypePointer, &[20, 6, 6]);
    a.op(Opcode::Variable, &[20, 21, 6]);
    let mut load = 0;
    a.function(30, 31, |a| {
        // Volatile | NonPrivatePointer.
        load = a.op(Opcode::Load, &[6, 32, 21, 1 | 0x20]);
        a.op(Opcode::Return, &[]);
    });
    let message = "MemoryAccess NonPrivatePointer requires the capability VulkanMemoryModel, which the module \
                   does not declare";
    found(&a, &[(ValidationClass::Capability, load + 4, Some(32), message)]);
}

/// SPV_KHR_opacity_micromap and SPV_KHR_abort, which rspirv 0.13 does not know.
#[test]
fn names_newer_than_rspirv_have_requirements() {
    let mut a = declaring(6, &[C::RayTracingKHR], &["SPV_KHR_ray_tracing"]);
    a.with_string(Opcode::EntryPoint, &[5313, 30], "main", &[]);
    let mode = a.op(Opcode::ExecutionModeId, &[30, 6031, 9]);
    a.types();
    a.op(Opcode::ConstantTrue, &[3, 9]);
    let mut abort = 0;
    a.function(30, 31, |a| {
        abort = a.op(Opcode::AbortKHR, &[5, 8]);
    });
    let all = findings(&a);
    let all: Vec<_> = all.iter().map(|one| (one.word, one.name.as_str(), one.fix.as_str())).collect();
    let micromap = "declare `OpCapability RayTracingOpacityMicromapExecutionModeKHR`";
    assert_eq!(
        all,
        [
            (mode + 2, "ExecutionMode OpacityMicromapIdKHR", micromap),
            (abort, "OpAbortKHR", "declare `OpCapability AbortKHR`"),
        ]
    );
}

/// A finding names the opcode of its instruction, so the tables must have it.
#[test]
fn opcodes_with_other_requirements_are_known() {
    let unknown: Vec<_> = OPCODES.iter().filter(|entry| !Opcode(entry.number as u16).is_known()).collect();
    assert_eq!(unknown.iter().map(|entry| entry.name).collect::<Vec<_>>(), [""; 0]);
}

/// VUID-StandaloneSpirv-OpTypeRuntimeArray-04680 names the capability.
#[test]
fn an_array_of_descriptors_without_length_needs_its_capability() {
    let of = |capabilities: &[C]| {
        let mut a = shader(capabilities);
        a.op(Opcode::Decorate, &[20, 2]);
        a.op(Opcode::MemberDecorate, &[20, 0, 35, 0]);
        a.types();
        a.op(Opcode::TypeStruct, &[20, 6]);
        a.op(Opcode::TypeRuntimeArray, &[21, 20]);
        a.op(Opcode::TypePointer, &[22, 12, 21]);
        a.op(Opcode::Variable, &[22, 23, 12]);
        findings(&a).iter().map(|one| one.fix.clone()).collect::<Vec<_>>()
    };
    assert_eq!(of(&[]), ["declare `OpCapability RuntimeDescriptorArray`"]);
    assert_eq!(of(&[C::RuntimeDescriptorArray]), [""; 0]);
}

/// SPV_KHR_16bit_storage: loads, stores and conversions, no arithmetic.
#[test]
fn numbers_for_memory_alone_are_not_computed_with() {
    let of = |capabilities: &[C], op: Opcode| {
        let mut a = shader(capabilities);
        a.op(Opcode::Decorate, &[20, 2]);
        a.op(Opcode::MemberDecorate, &[20, 0, 35, 0]);
        a.types();
        a.op(Opcode::TypeFloat, &[19, 16]);
        a.op(Opcode::TypeStruct, &[20, 19]);
        a.op(Opcode::TypePointer, &[21, 12, 20]);
        a.op(Opcode::TypePointer, &[22, 12, 19]);
        a.op(Opcode::Variable, &[21, 23, 12]);
        a.op(Opcode::Constant, &[5, 24, 0]);
        a.function(30, 31, |a| {
            a.op(Opcode::AccessChain, &[22, 32, 23, 24]);
            a.op(Opcode::Load, &[19, 33, 32]);
            match op {
                Opcode::FConvert => a.op(op, &[6, 34, 33]),
                _ => a.op(op, &[19, 34, 33]),
            };
            a.op(Opcode::Return, &[]);
        });
        findings(&a).iter().map(|one| one.message.clone()).collect::<Vec<_>>()
    };
    let storage = [C::StorageBuffer16BitAccess];
    assert_eq!(of(&storage, Opcode::FConvert), [""; 0]);
    assert_eq!(
        of(&storage, Opcode::FNegate),
        ["OpFNegate of 16-bit floats requires the capability Float16, which the module does not declare"]
    );
    assert_eq!(of(&[C::Float16, C::StorageBuffer16BitAccess], Opcode::FNegate), [""; 0]);
    let other = of(&[C::StoragePushConstant16], Opcode::FConvert);
    assert_eq!(other.len(), 1);
    assert!(other[0].contains("a variable with 16-bit numbers in storage class StorageBuffer"), "{other:?}");
}

#[test]
fn vulkan_has_no_kernels() {
    let all = findings(&declaring(6, &[C::Shader, C::Kernel], &[]));
    let rules: Vec<_> = all.iter().map(|one| (one.rule.as_str(), one.message.as_str())).collect();
    let message = "Vulkan has no feature for the capability Kernel";
    assert_eq!(rules, [("VUID-VkShaderModuleCreateInfo-pCode-08740", message)]);
}

#[test]
fn a_warning_lists_all_that_needs_one_declaration() {
    let mut a = shader(&[]);
    a.types();
    a.op(Opcode::TypeRayQueryKHR, &[21]);
    a.op(Opcode::TypePointer, &[22, 6, 21]);
    a.op(Opcode::Variable, &[22, 23, 6]);
    a.op(Opcode::TypeFloat, &[24, 64]);
    a.function(30, 31, |a| {
        a.op(Opcode::RayQueryTerminateKHR, &[23]);
        a.op(Opcode::RayQueryTerminateKHR, &[23]);
        a.op(Opcode::Return, &[]);
    });
    let module: Module = a.loaded();
    let warnings = module.declaration_warnings("a.spv");
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(
        warnings[0].starts_with("warning: a.spv: OpTypeRayQueryKHR requires the capability RayQueryKHR")
            && warnings[0]
                .ends_with("; declare `OpCapability RayQueryKHR`; also required by OpRayQueryTerminateKHR"),
        "{warnings:?}"
    );
    let error = module.check_declarations().unwrap_err();
    assert_eq!((error.kind(), error.others().len()), (ErrorKind::InvalidModule, 2));
}
