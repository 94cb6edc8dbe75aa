//! Modules that load, and what they contain.

use pretty_assertions::assert_eq;

use crate::module::assemble::Assembler;
use crate::module::constant::ConstantValue;
use crate::module::interface::Stage;
use crate::module::ty::{MatrixLayout, Type};
use crate::module::{Definition, Id, Opcode, load};
use anyhit_base::error::ErrorKind;

/// A ray-generation shader with a function, a selection, a phi, a buffer and names.
pub(super) fn sample() -> Assembler {
    let mut a = Assembler::bare(200);
    a.op(Opcode::Capability, &[4479]);
    a.with_string(Opcode::Extension, &[], "SPV_KHR_ray_tracing", &[]);
    a.with_string(Opcode::ExtInstImport, &[100], "GLSL.std.450", &[]);
    a.op(Opcode::MemoryModel, &[0, 1]);
    a.with_string(Opcode::EntryPoint, &[5313, 30], "main", &[20]);
    a.with_string(Opcode::String, &[101], "a.rgen", &[]);
    a.with_string(Opcode::Source, &[2, 460, 101], "void main() {}\n", &[]);
    a.with_string(Opcode::Name, &[30], "main", &[]);
    a.with_string(Opcode::Name, &[15], "Buffer", &[]);
    a.with_string(Opcode::MemberName, &[15, 0], "m", &[]);
    a.with_string(Opcode::MemberName, &[15, 1], "list", &[]);
    a.op(Opcode::Decorate, &[15, 2]);
    a.op(Opcode::MemberDecorate, &[15, 0, 35, 0]);
    a.op(Opcode::MemberDecorate, &[15, 0, 4]);
    a.op(Opcode::MemberDecorate, &[15, 0, 7, 16]);
    a.op(Opcode::MemberDecorate, &[15, 1, 35, 48]);
    a.op(Opcode::Decorate, &[14, 6, 4]);
    a.op(Opcode::Decorate, &[20, 34, 1]);
    a.op(Opcode::Decorate, &[20, 33, 2]);
    a.op(Opcode::Decorate, &[10, 1, 7]);
    a.types();
    a.op(Opcode::SpecConstant, &[5, 10, 4]);
    a.op(Opcode::ConstantTrue, &[3, 11]);
    a.op(Opcode::TypeMatrix, &[13, 7, 3]);
    a.op(Opcode::TypeRuntimeArray, &[14, 6]);
    a.op(Opcode::TypeStruct, &[15, 13, 14]);
    a.op(Opcode::TypePointer, &[16, 12, 15]);
    a.op(Opcode::TypeFunction, &[17, 6, 6]);
    a.op(Opcode::Constant, &[6, 18, 1.5f32.to_bits()]);
    a.op(Opcode::Variable, &[16, 20, 12]);
    a.function(30, 31, |a| {
        a.op(Opcode::Line, &[101, 3, 5]);
        a.op(Opcode::FunctionCall, &[6, 32, 40, 18]);
        a.op(Opcode::SelectionMerge, &[33, 0]);
        a.op(Opcode::BranchConditional, &[11, 34, 33]);
        a.op(Opcode::Label, &[34]);
        a.op(Opcode::Branch, &[33]);
        a.op(Opcode::Label, &[33]);
        a.op(Opcode::Phi, &[6, 35, 18, 31, 32, 34]);
        a.op(Opcode::Return, &[]);
    });
    a.op(Opcode::Function, &[6, 40, 0, 17]);
    a.op(Opcode::FunctionParameter, &[6, 41]);
    a.op(Opcode::Label, &[42]);
    a.op(Opcode::ExtInst, &[6, 43, 100, 13, 41]);
    a.op(Opcode::ReturnValue, &[43]);
    a.op(Opcode::FunctionEnd, &[]);
    a
}

#[test]
fn everything_lands_in_its_arena() {
    let module = sample().loaded();
    assert_eq!(module.version, (1, 6));
    assert_eq!(module.memory_model, (0, 1));
    assert_eq!(module.capabilities, [4479]);
    assert_eq!(module.extensions, ["SPV_KHR_ray_tracing"]);
    assert_eq!(module.instruction_sets, ["GLSL.std.450"]);
    let entry = &module.entry_points[0];
    assert_eq!((entry.stage, entry.name.as_str()), (Stage::RayGeneration, "main"));
    assert_eq!((entry.function, &entry.interface[..]), (Id(30), &[Id(20)][..]));

    let Some(Definition::Type(ty)) = module.definition(Id(15)) else { panic!() };
    let Type::Struct { members, block: true, buffer_block: false } = module.ty(ty) else { panic!() };
    assert_eq!(members[0].offset, Some(0));
    assert_eq!(members[0].matrix, Some(MatrixLayout { stride: 16, row_major: true }));
    assert_eq!((members[1].offset, members[1].name.as_str()), (Some(48), "list"));
    let Type::RuntimeArray { stride, .. } = module.ty(members[1].ty) else { panic!() };
    assert_eq!(*stride, Some(4));
    assert_eq!(module.decorations.literal(Id(20), 33), Some(2));

    assert_eq!(module.constants[1].spec_id, Some(7));
    assert_eq!(module.constants[1].value, ConstantValue::Scalar(4));
    assert_eq!(module.constant_scalar(Id(10)), None);
    assert_eq!(module.constant_scalar(Id(8)), Some(3));
    assert_eq!(module.constant_scalar(Id(18)), Some(0x3fc0_0000));

    let main = &module.functions[0];
    let opcodes = |block: usize| main.blocks[block].instructions.iter().map(|one| one.opcode.0);
    assert_eq!(opcodes(0).collect::<Vec<_>>(), [57, 247, 250]);
    assert_eq!(opcodes(1).collect::<Vec<_>>(), [249]);
    assert_eq!(opcodes(2).collect::<Vec<_>>(), [245, 253]);
    assert_eq!(module.definition(Id(35)), Some(Definition::Result(0, 2, 0)));
    assert_eq!(module.definition(Id(34)), Some(Definition::Label(0, 1)));
    assert_eq!(module.operands(&main.blocks[2].instructions[0]), [18, 31, 32, 34]);
    assert_eq!(module.type_of(Id(41)), module.type_of(Id(43)));
    assert_eq!(module.operand_ids(&module.functions[1].blocks[0].instructions[0])[..], [Id(100), Id(41)]);
    assert_eq!(module.branch_targets(&main.blocks[0].instructions[2])[..], [Id(34), Id(33)]);
}

#[test]
fn big_endian_bytes_give_the_same_module() {
    let sample = sample();
    let big: Vec<u8> = sample.words.iter().flat_map(|word| word.to_be_bytes()).collect();
    let module = load(&big).unwrap();
    assert_eq!(module.words, sample.words);
    assert_eq!(module.name(Id(30)), Some("main"));
}

#[test]
fn lines_hold_to_the_end_of_their_block() {
    let module = sample().loaded();
    let main = &module.functions[0];
    let line =
        |block: usize, index: usize| module.debug_info.line_at(main.blocks[block].instructions[index].offset);
    let first = line(0, 0).unwrap();
    assert_eq!((first.line, first.column), (3, 5));
    assert_eq!(module.debug_info.files[first.file as usize].name, "a.rgen");
    assert_eq!(module.debug_info.files[0].text.as_deref(), Some("void main() {}\n"));
    assert_eq!(line(0, 2), Some(first));
    assert_eq!(line(1, 0), None);
}

#[test]
fn unknown_opcodes_are_kept_with_what_they_may_define() {
    let mut a = Assembler::new();
    a.types();
    // A type, a constant and two results of unknown opcodes.
    a.op(Opcode(9000), &[20, 1, 2]);
    a.op(Opcode::TypePointer, &[21, 7, 20]);
    a.op(Opcode(9001), &[20, 22]);
    a.op(Opcode::TypeStruct, &[23, 20]);
    a.op(Opcode::ConstantComposite, &[23, 24, 22]);
    a.function(30, 31, |a| {
        a.op(Opcode::Variable, &[21, 32, 7]);
        a.op(Opcode(9002), &[20, 33, 32]);
        a.op(Opcode::Store, &[32, 33]);
        a.op(Opcode::Branch, &[34]);
        a.op(Opcode::Label, &[34]);
        a.op(Opcode(9003), &[]);
    });
    let module = a.loaded();
    let ty = module.type_with_id(Id(20)).unwrap();
    assert_eq!(*module.ty(ty), Type::Other(Opcode(9000)));
    let blocks = &module.functions[0].blocks;
    let unknown = &blocks[0].instructions[1];
    assert_eq!((unknown.opcode, unknown.result_type, unknown.result), (Opcode(9002), None, None));
    assert_eq!(module.operands(unknown), [20, 33, 32]);
    assert_eq!(module.definition(Id(33)), None);
    assert_eq!(blocks[1].instructions.len(), 1);
}

#[test]
fn unknown_enumerants_are_kept() {
    let mut a = Assembler::bare(100);
    a.op(Opcode::Capability, &[6032]);
    a.op(Opcode::Capability, &[60_000]);
    a.op(Opcode::MemoryModel, &[0, 99]);
    a.op(Opcode::Decorate, &[6, 40_000, 1, 2, 3]);
    a.types();
    a.op(Opcode::TypePointer, &[20, 30_000, 6]);
    a.op(Opcode::Variable, &[20, 21, 30_000]);
    let module = a.loaded();
    assert_eq!(module.capabilities, [6032, 60_000]);
    assert_eq!(module.memory_model, (0, 99));
    assert_eq!(module.variables[0].storage_class, 30_000);
    assert_eq!(module.decorations.find(Id(6), 40_000).unwrap().operands, [1, 2, 3]);
}

#[test]
fn unsupported_types_are_kept() {
    let mut a = Assembler::new();
    a.op(Opcode::TypeInt, &[1, 24, 0]);
    a.op(Opcode::Constant, &[1, 2, 5]);
    a.op(Opcode::TypeEvent, &[3]);
    a.with_string(Opcode::TypeOpaque, &[4], "name", &[]);
    a.op(Opcode::TypeFloat, &[5, 16, 0]);
    a.op(Opcode::TypeUntypedPointerKHR, &[6, 12]);
    a.op(Opcode::UntypedVariableKHR, &[6, 7, 12, 5]);
    let module = a.loaded();
    let types: Vec<String> = (0..module.types.len())
        .map(|index| module.describe_type(crate::module::ty::TypeId(index as u32)))
        .collect();
    assert_eq!(types, ["OpTypeInt", "OpTypeEvent", "OpTypeOpaque", "bfloat16_t", "pointer to StorageBuffer"]);
    assert_eq!(module.constants[0].value, ConstantValue::Other(Opcode::Constant));
    assert_eq!(module.definition(Id(7)), Some(Definition::Variable(0)));
}

#[test]
fn groups_modes_and_strings_reach_their_targets() {
    let mut a = Assembler::new();
    a.with_string(Opcode::EntryPoint, &[5, 30], "one", &[]);
    a.with_string(Opcode::EntryPoint, &[5, 30], "two", &[]);
    a.op(Opcode::ExecutionMode, &[30, 17, 8, 4, 1]);
    a.op(Opcode::ExecutionModeId, &[30, 38, 8, 8, 8]);
    a.op(Opcode::Decorate, &[40, 34, 3]);
    a.op(Opcode::Decorate, &[40, 33, 1]);
    a.op(Opcode::DecorationGroup, &[40]);
    a.op(Opcode::GroupDecorate, &[40, 21, 22]);
    a.op(Opcode::Decorate, &[41, 35, 12]);
    a.op(Opcode::DecorationGroup, &[41]);
    a.op(Opcode::GroupMemberDecorate, &[41, 23, 1]);
    a.with_string(Opcode::DecorateString, &[21, 5635], "TEXCOORD", &[]);
    a.op(Opcode::DecorateId, &[22, 46, 8]);
    a.types();
    a.op(Opcode::TypePointer, &[20, 6, 6]);
    a.op(Opcode::Variable, &[20, 21, 6]);
    a.op(Opcode::Variable, &[20, 22, 6]);
    a.op(Opcode::TypeStruct, &[23, 6, 6]);
    a.function(30, 31, |a| {
        a.op(Opcode::Return, &[]);
    });
    let module = a.loaded();
    for entry in &module.entry_points {
        assert_eq!(entry.modes, [(17, vec![8, 4, 1]), (38, vec![8, 8, 8])]);
    }
    for id in [21, 22] {
        assert_eq!(module.decorations.literal(Id(id), 34), Some(3));
        assert_eq!(module.decorations.literal(Id(id), 33), Some(1));
    }
    assert_eq!(module.decorations.find_member(Id(23), 1, 35).unwrap().operands, [12]);
    let Type::Struct { members, .. } = module.ty(module.type_with_id(Id(23)).unwrap()) else { panic!() };
    assert_eq!((members[0].offset, members[1].offset), (None, Some(12)));
    assert_eq!(module.decorations.find(Id(21), 5635).unwrap().operands.len(), 3);
    assert_eq!(module.decorations.literal(Id(22), 46), Some(8));
}

#[test]
fn wide_switches_and_specialization_operations_are_read() {
    let mut a = Assembler::new();
    a.types();
    a.op(Opcode::TypeInt, &[20, 64, 1]);
    a.op(Opcode::Constant, &[20, 21, 7, 1]);
    a.op(Opcode::SpecConstantOp, &[5, 22, u32::from(Opcode::IAdd.0), 8, 8]);
    a.op(Opcode::TypeArray, &[23, 6, 22]);
    a.function(30, 31, |a| {
        a.op(Opcode::SelectionMerge, &[33, 0]);
        a.op(Opcode::Switch, &[21, 33, 7, 1, 32, 8, 1, 33]);
        a.op(Opcode::Label, &[32]);
        a.op(Opcode::Branch, &[33]);
        a.op(Opcode::Label, &[33]);
        a.op(Opcode::Return, &[]);
    });
    let module = a.loaded();
    assert_eq!(module.constant_scalar(Id(21)), Some(0x1_0000_0007));
    let operation = ConstantValue::Operation { opcode: Opcode::IAdd, operands: vec![8, 8] };
    assert_eq!(module.constants[2].value, operation);
    let switch = &module.functions[0].blocks[0].instructions[1];
    assert_eq!(module.branch_targets(switch)[..], [Id(33), Id(32), Id(33)]);
    assert_eq!(module.operand_ids(switch)[..], [Id(21), Id(33), Id(32), Id(33)]);
}

#[test]
fn libraries_kernels_and_imports_load() {
    let mut a = Assembler::bare(100);
    a.op(Opcode::Capability, &[5]);
    a.op(Opcode::MemoryModel, &[2, 2]);
    a.with_string(Opcode::Decorate, &[30, 41], "imported", &[1]);
    a.types();
    a.op(Opcode::Function, &[1, 30, 0, 2]);
    a.op(Opcode::FunctionEnd, &[]);
    let module = a.loaded();
    assert_eq!(module.memory_model, (2, 2));
    assert!(module.functions[0].blocks.is_empty());
}

#[test]
fn too_many_copies_of_decorations_are_refused() {
    let mut a = Assembler::new();
    for _ in 0..2000 {
        a.op(Opcode::Decorate, &[40, 33, 1]);
    }
    a.op(Opcode::DecorationGroup, &[40]);
    let at = a.op(Opcode::GroupDecorate, &[&[40][..], &[6; 2000]].concat());
    a.types();
    let error = a.refused();
    assert_eq!(error.kind(), ErrorKind::UnsupportedModule);
    assert!(matches!(error.places().next(), Some((anyhit_base::error::Place::Word(word), _)) if *word > at));
}
