//! The parts of SPIR-V that run, that do not run yet, and that this crate will not run.
//!
//! They are computed from the instruction set itself: an instruction runs where a family of kernels
//! has its number, or a section lists it among the opcodes that it translates. The rest is classed
//! by hand in `lists`, mostly by the capability that an instruction needs; a test walks rspirv's
//! grammar and fails where one is classed nowhere.

mod lists;
pub mod table;

use rspirv::grammar::INSTRUCTION_TABLE;
use rspirv::spirv::{self, Capability, GlslStd450Op};

use crate::module::heap::Heap;
use crate::module::interface::EntryPoint;
use crate::module::names::{builtin_name, ext_inst_name, storage_class_name};
use crate::module::{Definition, Id, Instruction, Module, Opcode};
use crate::ops::lane_kernel::{InstructionSet, family};
use crate::ops::{
    address, amd, atomic, barrier, builtin, composite, cooperative, derivative, dot_product, heap,
    hit_object, image, irregular, linear_algebra, mixed_dot_product, pointer, ray_query, ray_tracing,
    subgroup, untyped_pointer,
};

/// Whether something of SPIR-V runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Support {
    /// It runs.
    Supported(&'static str),
    /// It should run and does not yet: a gap of this crate.
    Unsupported(&'static str),
    /// It does not belong to ray tracing or compute on Vulkan, or is declared out of scope.
    OutOfScope(&'static str),
}

impl Support {
    /// The group under which tables list it.
    pub fn group(self) -> &'static str {
        match self {
            Self::Supported(group) | Self::Unsupported(group) | Self::OutOfScope(group) => group,
        }
    }

    /// Whether it runs.
    pub fn is_supported(self) -> bool {
        matches!(self, Self::Supported(_))
    }

    /// The message for a name of this class, where it does not run.
    fn refusal(self, name: &str) -> Option<String> {
        match self {
            Self::Supported(_) => None,
            Self::Unsupported(_) => Some(format!("{name} is not supported")),
            Self::OutOfScope(group) => Some(format!("{name} is out of scope ({group})")),
        }
    }
}

/// The class of an opcode; `None` where neither the instruction set nor a list knows it.
pub fn opcode(op: Opcode) -> Option<Support> {
    if let Some(group) = section_of(op) {
        return Some(Support::Supported(group));
    }
    if let Some(group) = lists::group_of(lists::UNSUPPORTED_OPCODES, op) {
        return Some(Support::Unsupported(group));
    }
    if let Some(group) = lists::group_of(lists::OUT_OF_SCOPE_OPCODES, op) {
        return Some(Support::OutOfScope(group));
    }
    let entry = INSTRUCTION_TABLE.iter().find(|entry| op == entry.opcode.into())?;
    by_capabilities(entry.capabilities)
}

/// The class of an instruction of `GLSL.std.450`; `None` where no list knows it.
pub fn glsl(number: u32) -> Option<Support> {
    let op = GlslStd450Op::from_u32(number)?;
    if family(InstructionSet::Glsl, number).is_some()
        || irregular::GLSL.contains(&op)
        || linear_algebra::GLSL.contains(&op)
    {
        return Some(Support::Supported("GLSL.std.450"));
    }
    match op {
        GlslStd450Op::IMix => Some(Support::OutOfScope(lists::RESERVED)),
        GlslStd450Op::InterpolateAtCentroid
        | GlslStd450Op::InterpolateAtSample
        | GlslStd450Op::InterpolateAtOffset => Some(Support::OutOfScope(lists::GRAPHICS)),
        _ => None,
    }
}

/// The class of an instruction set as a whole.
pub fn instruction_set(name: &str) -> Support {
    match name {
        "GLSL.std.450" => Support::Supported("GLSL.std.450"),
        // These sets change no result.
        _ if name.starts_with("NonSemantic.") => Support::Supported("debug information"),
        "DebugInfo" | "OpenCL.DebugInfo.100" => Support::Supported("debug information"),
        amd::TRINARY | amd::BALLOT => Support::Supported("SPV_AMD"),
        "SPV_AMD_shader_explicit_vertex_parameter" => Support::OutOfScope(lists::GRAPHICS),
        "OpenCL.std" => Support::OutOfScope(lists::KERNELS),
        _ if name.starts_with("TOSA.") || name.starts_with("Arm.") => Support::OutOfScope(lists::TENSORS),
        _ => Support::Unsupported("other instruction sets"),
    }
}

/// The class of a builtin; `None` where no list knows it.
pub fn builtin(number: u32) -> Option<Support> {
    if builtin::find(number).is_some() {
        return Some(Support::Supported("ray tracing"));
    }
    if Heap::of_builtin(number).is_some() {
        return Some(Support::Supported("descriptor heap"));
    }
    let known = spirv::BuiltIn::from_u32(number)?;
    let unsupported = lists::group_of(lists::UNSUPPORTED_BUILTINS, known).map(Support::Unsupported);
    unsupported.or_else(|| lists::group_of(lists::OUT_OF_SCOPE_BUILTINS, known).map(Support::OutOfScope))
}

/// The class of a storage class; `None` where no list knows it.
pub fn storage_class(number: u32) -> Option<Support> {
    // No variable is in Image: OpImageTexelPointer makes pointers to it.
    if pointer::STORAGE_CLASSES.contains(&number) || number == spirv::StorageClass::Image as u32 {
        return Some(Support::Supported("storage classes"));
    }
    let known = spirv::StorageClass::from_u32(number)?;
    let unsupported = lists::group_of(lists::UNSUPPORTED_STORAGE, known).map(Support::Unsupported);
    unsupported.or_else(|| lists::group_of(lists::OUT_OF_SCOPE_STORAGE, known).map(Support::OutOfScope))
}

/// Something that an entry point uses and that does not run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The specification's name.
    pub name: String,
    /// The message about it.
    pub message: String,
    /// How many instructions use it.
    pub count: usize,
    /// The offset of the first of them in the module, in words.
    pub offset: u32,
    /// The offsets of all instructions that name it, the uses of a variable included.
    pub offsets: Vec<u32>,
}

/// All that an entry point's call tree and interface name and that does not run, each once, in the
/// order of the module. Linear in the size of the functions reached.
///
/// None found does not mean that the entry point runs: an instruction may be supported for some
/// operands only. Lowering decides.
pub fn gaps(module: &Module, entry: &EntryPoint) -> Vec<Gap> {
    let mut gaps: Vec<Gap> = Vec::new();
    let mut add = |name: String, support: Option<Support>, offset: u32| {
        let support = support.unwrap_or(Support::Unsupported("unknown"));
        let Some(message) = support.refusal(&name) else { return };
        match gaps.iter_mut().find(|gap| gap.name == name) {
            Some(gap) => {
                gap.count += 1;
                gap.offsets.push(offset);
            }
            None => gaps.push(Gap { name, message, count: 1, offset, offsets: vec![offset] }),
        }
    };
    // The gaps of a variable by its id: where it is used, they are met.
    let mut variables: Vec<(Id, String)> = Vec::new();
    for variable in module.interface_of(entry) {
        let offset = match module.definition(variable.id) {
            Some(Definition::Variable(index)) => module.variables[index as usize].offset,
            _ => entry.offset,
        };
        let class = variable.storage_class;
        let name = format!("storage class {}", storage_class_name(class));
        variables.push((variable.id, name.clone()));
        add(name, storage_class(class), offset);
        if let Some(number) = variable.builtin {
            let name = format!("the builtin {}", builtin_name(number));
            variables.push((variable.id, name.clone()));
            add(name, builtin(number), offset);
        }
    }
    for function in module.call_tree(entry.function) {
        for instruction in module.functions[function as usize].instructions() {
            match extended(module, instruction) {
                Some((name, support)) => add(name, support, instruction.offset),
                None => {
                    let name = instruction.opcode.to_string();
                    add(name, opcode(instruction.opcode), instruction.offset);
                }
            }
        }
    }
    variables.retain(|(_, name)| gaps.iter().any(|gap| gap.name == *name));
    if !variables.is_empty() {
        for function in module.call_tree(entry.function) {
            for instruction in module.functions[function as usize].instructions() {
                let used = module.operand_ids(instruction);
                for (_, name) in variables.iter().filter(|(id, _)| used.contains(id)) {
                    let gap = gaps.iter_mut().find(|gap| gap.name == *name);
                    gap.into_iter().for_each(|gap| gap.offsets.push(instruction.offset));
                }
            }
        }
    }
    gaps
}

/// Name and class of an extended instruction; `None` for any other.
fn extended(module: &Module, instruction: &Instruction) -> Option<(String, Option<Support>)> {
    if instruction.opcode != Opcode::ExtInst {
        return None;
    }
    let &[set, number, ..] = module.operands(instruction) else { return None };
    let Some(Definition::InstructionSet(index)) = module.definition(Id(set)) else { return None };
    let set = module.instruction_sets[index as usize].as_str();
    let support = if set == "GLSL.std.450" { glsl(number) } else { Some(instruction_set(set)) };
    Some((format!("{set} {}", ext_inst_name(set, number)), support))
}

/// The section whose kernels or list hold an opcode.
fn section_of(op: Opcode) -> Option<&'static str> {
    for (group, families) in lists::SECTIONS {
        if families
            .iter()
            .any(|family| family.set == InstructionSet::Core && family.number == u32::from(op.0))
        {
            return Some(group);
        }
    }
    let translated = [
        ("composites", composite::OPCODES),
        ("memory", pointer::OPCODES),
        ("pointers and device addresses", address::OPCODES),
        ("pointers and device addresses", untyped_pointer::OPCODES),
        ("descriptor heap", heap::OPCODES),
        ("atomics and barriers", atomic::OPCODES),
        ("atomics and barriers", barrier::OPCODES),
        ("subgroups", subgroup::OPCODES),
        ("derivatives (compute)", derivative::OPCODES),
        ("arithmetic", dot_product::OPCODES),
        ("arithmetic", mixed_dot_product::OPCODES),
        ("linear algebra", linear_algebra::OPCODES),
        ("cooperative vectors", cooperative::OPCODES),
        ("cooperative matrices", cooperative::MATRIX_OPCODES),
        ("images", image::OPCODES),
        ("images", image::processing::OPCODES),
        ("ray tracing", ray_tracing::OPCODES),
        ("ray queries", ray_query::OPCODES),
        ("hit objects", hit_object::OPCODES),
        ("conversion, carries, bit fields", irregular::OPCODES),
    ];
    let listed = translated.iter().find(|(_, opcodes)| opcodes.contains(&op)).map(|&(group, _)| group);
    listed.or_else(|| lists::group_of(lists::READ_BY_MODULE_AND_PROGRAM, op))
}

/// The class of what needs one of these capabilities.
fn by_capabilities(capabilities: &[Capability]) -> Option<Support> {
    let of = |lists| capabilities.iter().find_map(|&one| lists::group_of(lists, one));
    if let Some(group) = of(lists::UNSUPPORTED_CAPABILITIES) {
        return Some(Support::Unsupported(group));
    }
    let kernels = |one: &Capability| {
        let name = format!("{one:?}");
        name.ends_with("INTEL") || name.ends_with("ALTERA")
    };
    let out = of(lists::OUT_OF_SCOPE_CAPABILITIES);
    let out = out.or_else(|| capabilities.iter().any(kernels).then_some(lists::KERNELS));
    out.map(Support::OutOfScope)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::module::assemble::Assembler;
    use crate::module::interface::Stage;
    use crate::ops::translate::Translator;
    use crate::ops::translate_instruction;
    use anyhit_base::error::ErrorKind;

    /// Whether the sections' translators refuse an opcode as one that none of them knows.
    ///
    /// The operands are ids that nothing defines, so that every other outcome is another error.
    fn is_refused(opcode: Opcode) -> bool {
        if opcode == Opcode::Nop {
            return false;
        }
        let mut a = Assembler::new();
        a.types();
        let mut module = a.loaded();
        let start = module.words.len() as u32;
        module.words.extend([u32::MAX; 16]);
        let instruction = Instruction {
            opcode,
            offset: 0,
            result_type: Some(Id(u32::MAX)),
            result: Some(Id(u32::MAX)),
            operands: start..start + 16,
        };
        let mut translator = Translator::new(&module, Stage::ClosestHit);
        match translate_instruction(&mut translator, &instruction) {
            Ok(()) => false,
            Err(error) => {
                error.kind() == ErrorKind::UnsupportedModule
                    && error.message() == format!("{opcode} is not supported")
            }
        }
    }

    #[test]
    fn the_translators_know_what_is_called_supported_and_nothing_else() {
        let mut counts = [0; 2];
        let mut wrong = Vec::new();
        for op in Opcode::all() {
            // Instructions that need implicit derivatives are rejected by the rule that they break.
            if lists::group_of(lists::READ_BY_MODULE_AND_PROGRAM, op).is_some()
                || image::IMPLICIT.contains(&op)
            {
                continue;
            }
            let supported = opcode(op).is_some_and(Support::is_supported);
            if supported == is_refused(op) {
                wrong.push(format!("{op}: called supported: {supported}"));
            }
            counts[usize::from(supported)] += 1;
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
        assert!(counts.iter().all(|&count| count > 100), "{counts:?}");
    }

    #[test]
    fn nothing_is_classed_twice() {
        let mut twice = Vec::new();
        for op in Opcode::all() {
            let by_list = [
                section_of(op),
                lists::group_of(lists::UNSUPPORTED_OPCODES, op),
                lists::group_of(lists::OUT_OF_SCOPE_OPCODES, op),
            ];
            if by_list.iter().flatten().count() > 1 {
                twice.push(op);
            }
        }
        assert_eq!(twice, []);
        for number in 0..u32::from(u16::MAX) {
            let Some(known) = spirv::BuiltIn::from_u32(number) else { continue };
            let by_list = [
                builtin::find(number).map(|_| "supported"),
                lists::group_of(lists::UNSUPPORTED_BUILTINS, known),
                lists::group_of(lists::OUT_OF_SCOPE_BUILTINS, known),
            ];
            assert!(by_list.iter().flatten().count() <= 1, "{known:?}: {by_list:?}");
        }
    }

    #[test]
    fn gaps_are_counted_and_named_once() {
        let mut a = Assembler::new();
        a.with_string(Opcode::EntryPoint, &[5316, 30], "hit", &[]);
        a.op(Opcode::Decorate, &[20, 11, 5021]);
        a.types();
        a.op(Opcode::TypePointer, &[10, 1, 5]);
        a.op(Opcode::Variable, &[10, 20, 1]);
        a.function(30, 31, |a| {
            a.op(Opcode::Load, &[5, 32, 20]);
            a.op(Opcode::Undef, &[6, 9]);
            a.op(Opcode::DemoteToHelperInvocation, &[]);
            a.op(Opcode::DemoteToHelperInvocation, &[]);
            a.op(Opcode::Return, &[]);
        });
        let module = a.loaded();
        let gaps = gaps(&module, &module.entry_points[0]);
        let told: Vec<_> = gaps.iter().map(|gap| (gap.message.as_str(), gap.count)).collect();
        assert_eq!(
            told,
            [
                (
                    "the builtin RemainingRecursionLevelsAMDX is out of scope (work graphs: neither ray-tracing nor compute pipelines)",
                    1
                ),
                ("OpDemoteToHelperInvocation is out of scope (graphics stages)", 2)
            ]
        );
    }
}
