//! Modules that load, and what they contain.

use pretty_assertions::assert_eq;
use rspirv::spirv::Op;

use crate::module::assemble::Assembler;
use crate::module::constant::ConstantValue;
use crate::module::interface::Stage;
use crate::module::ty::{MatrixLayout, Type};
use crate::module::{Definition, Id, load};
use anyhit_base::error::ErrorKind;

/// A ray-generation shader with a function, a selection, a phi, a buffer and names.
pub(super) fn sample() -> Assembler {
    let mut a = Assembler::bare(200);
    a.op(Op::Capability, &[4479]);
    a.with_string(Op::Extension, &[], "SPV_KHR_ray_tracing", &[]);
    a.with_string(Op::ExtInstImport, &[100], "GLSL.std.450", &[]);
    a.op(Op::MemoryModel, &[0, 1]);
    a.with_string(Op::EntryPoint, &[5313, 30], "main", &[20]);
    a.with_string(Op::String, &[101], "a.rgen", &[]);
    a.with_string(Op::Source, &[2, 460, 101], "void main() {}\n", &[]);
    a.with_string(Op::Name, &[30], "main", &[]);
    a.with_string(Op::Name, &[15], "Buffer", &[]);
    a.with_string(Op::MemberName, &[15, 0], "m", &[]);
    a.with_string(Op::MemberName, &[15, 1], "list", &[]);
    a.op(Op::Decorate, &[15, 2]);
    a.op(Op::MemberDecorate, &[15, 0, 35, 0]);
    a.op(Op::MemberDecorate, &[15, 0, 4]);
    a.op(Op::MemberDecorate, &[15, 0, 7, 16]);
    a.op(Op::MemberDecorate, &[15, 1, 35, 48]);
    a.op(Op::Decorate, &[14, 6, 4]);
    a.op(Op::Decorate, &[20, 34, 1]);
    a.op(Op::Decorate, &[20, 33, 2]);
    a.op(Op::Decorate, &[10, 1, 7]);
    a.types();
    a.op(Op::SpecConstant, &[5, 10, 4]);
    a.op(Op::ConstantTrue, &[3, 11]);
    a.op(Op::TypeMatrix, &[13, 7, 3]);
    a.op(Op::TypeRuntimeArray, &[14, 6]);
    a.op(Op::TypeStruct, &[15, 13, 14]);
    a.op(Op::TypePointer, &[16, 12, 15]);
    a.op(Op::TypeFunction, &[17, 6, 6]);
    a.op(Op::Constant, &[6, 18, 1.5f32.to_bits()]);
    a.op(Op::Variable, &[16, 20, 12]);
    a.function(30, 31, |a| {
        a.op(Op::Line, &[101, 3, 5]);
        a.op(Op::FunctionCall, &[6, 32, 40, 18]);
        a.op(Op::SelectionMerge, &[33, 0]);
        a.op(Op::BranchConditional, &[11, 34, 33]);
        a.op(Op::Label, &[34]);
        a.op(Op::Branch, &[33]);
        a.op(Op::Label, &[33]);
        a.op(Op::Phi, &[6, 35, 18, 31, 32, 34]);
        a.op(Op::Return, &[]);
    });
    a.op(Op::Function, &[6, 40, 0, 17]);
    a.op(Op::FunctionParameter, &[6, 41]);
    a.op(Op::Label, &[42]);
    a.op(Op::ExtInst, &[6, 43, 100, 13, 41]);
    a.op(Op::ReturnValue, &[43]);
    a.op(Op::FunctionEnd, &[]);
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
    let opcodes = |block: usize| main.blocks[block].instructions.iter().map(|one| one.opcode);
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
    a.raw(9000, &[20, 1, 2]);
    a.op(Op::TypePointer, &[21, 7, 20]);
    a.raw(9001, &[20, 22]);
    a.op(Op::TypeStruct, &[23, 20]);
    a.op(Op::ConstantComposite, &[23, 24, 22]);
    a.function(30, 31, |a| {
        a.op(Op::Variable, &[21, 32, 7]);
        a.raw(9002, &[20, 33, 32]);
        a.op(Op::Store, &[32, 33]);
        a.op(Op::Branch, &[34]);
        a.op(Op::Label, &[34]);
        a.raw(9003, &[]);
    });
    let module = a.loaded();
    let ty = module.type_with_id(Id(20)).unwrap();
    assert_eq!(*module.ty(ty), Type::Other(9000));
    let blocks = &module.functions[0].blocks;
    let unknown = &blocks[0].instructions[1];
    assert_eq!((unknown.opcode, unknown.result_type, unknown.result), (9002, None, None));
    assert_eq!(module.operands(unknown), [20, 33, 32]);
    assert_eq!(module.definition(Id(33)), None);
    assert_eq!(blocks[1].instructions.len(), 1);
}

#[test]
fn unknown_enumerants_are_kept() {
    let mut a = Assembler::bare(100);
    a.op(Op::Capability, &[6032]);
    a.op(Op::Capability, &[60_000]);
    a.op(Op::MemoryModel, &[0, 99]);
    a.op(Op::Decorate, &[6, 40_000, 1, 2, 3]);
    a.types();
    a.op(Op::TypePointer, &[20, 30_000, 6]);
    a.op(Op::Variable, &[20, 21, 30_000]);
    let module = a.loaded();
    assert_eq!(module.capabilities, [6032, 60_000]);
    assert_eq!(module.memory_model, (0, 99));
    assert_eq!(module.variables[0].storage_class, 30_000);
    assert_eq!(module.decorations.find(Id(6), 40_000).unwrap().operands, [1, 2, 3]);
}

#[test]
fn unsupported_types_are_kept() {
    let mut a = Assembler::new();
    a.op(Op::TypeInt, &[1, 24, 0]);
    a.op(Op::Constant, &[1, 2, 5]);
    a.op(Op::TypeEvent, &[3]);
    a.with_string(Op::TypeOpaque, &[4], "name", &[]);
    a.op(Op::TypeFloat, &[5, 16, 0]);
    a.op(Op::TypeUntypedPointerKHR, &[6, 12]);
    a.op(Op::UntypedVariableKHR, &[6, 7, 12, 5]);
    let module = a.loaded();
    let types: Vec<String> = (0..module.types.len())
        .map(|index| module.describe_type(crate::module::ty::TypeId(index as u32)))
        .collect();
    assert_eq!(types, ["OpTypeInt", "OpTypeEvent", "OpTypeOpaque", "bfloat16_t", "pointer to StorageBuffer"]);
    assert_eq!(module.constants[0].value, ConstantValue::Other(Op::Constant as u16));
    assert_eq!(module.definition(Id(7)), Some(Definition::Variable(0)));
}

#[test]
fn groups_modes_and_strings_reach_their_targets() {
    let mut a = Assembler::new();
    a.with_string(Op::EntryPoint, &[5, 30], "one", &[]);
    a.with_string(Op::EntryPoint, &[5, 30], "two", &[]);
    a.op(Op::ExecutionMode, &[30, 17, 8, 4, 1]);
    a.op(Op::ExecutionModeId, &[30, 38, 8, 8, 8]);
    a.op(Op::Decorate, &[40, 34, 3]);
    a.op(Op::Decorate, &[40, 33, 1]);
    a.op(Op::DecorationGroup, &[40]);
    a.op(Op::GroupDecorate, &[40, 21, 22]);
    a.op(Op::Decorate, &[41, 35, 12]);
    a.op(Op::DecorationGroup, &[41]);
    a.op(Op::GroupMemberDecorate, &[41, 23, 1]);
    a.with_string(Op::DecorateString, &[21, 5635], "TEXCOORD", &[]);
    a.op(Op::DecorateId, &[22, 46, 8]);
    a.types();
    a.op(Op::TypePointer, &[20, 6, 6]);
    a.op(Op::Variable, &[20, 21, 6]);
    a.op(Op::Variable, &[20, 22, 6]);
    a.op(Op::TypeStruct, &[23, 6, 6]);
    a.function(30, 31, |a| {
        a.op(Op::Return, &[]);
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
    a.op(Op::TypeInt, &[20, 64, 1]);
    a.op(Op::Constant, &[20, 21, 7, 1]);
    a.op(Op::SpecConstantOp, &[5, 22, Op::IAdd as u32, 8, 8]);
    a.op(Op::TypeArray, &[23, 6, 22]);
    a.function(30, 31, |a| {
        a.op(Op::SelectionMerge, &[33, 0]);
        a.op(Op::Switch, &[21, 33, 7, 1, 32, 8, 1, 33]);
        a.op(Op::Label, &[32]);
        a.op(Op::Branch, &[33]);
        a.op(Op::Label, &[33]);
        a.op(Op::Return, &[]);
    });
    let module = a.loaded();
    assert_eq!(module.constant_scalar(Id(21)), Some(0x1_0000_0007));
    let operation = ConstantValue::Operation { opcode: Op::IAdd as u16, operands: vec![8, 8] };
    assert_eq!(module.constants[2].value, operation);
    let switch = &module.functions[0].blocks[0].instructions[1];
    assert_eq!(module.branch_targets(switch)[..], [Id(33), Id(32), Id(33)]);
    assert_eq!(module.operand_ids(switch)[..], [Id(21), Id(33), Id(32), Id(33)]);
}

#[test]
fn libraries_kernels_and_imports_load() {
    let mut a = Assembler::bare(100);
    a.op(Op::Capability, &[5]);
    a.op(Op::MemoryModel, &[2, 2]);
    a.with_string(Op::Decorate, &[30, 41], "imported", &[1]);
    a.types();
    a.op(Op::Function, &[1, 30, 0, 2]);
    a.op(Op::FunctionEnd, &[]);
    let module = a.loaded();
    assert_eq!(module.memory_model, (2, 2));
    assert!(module.functions[0].blocks.is_empty());
}

#[test]
fn too_many_copies_of_decorations_are_refused() {
    let mut a = Assembler::new();
    for _ in 0..2000 {
        a.op(Op::Decorate, &[40, 33, 1]);
    }
    a.op(Op::DecorationGroup, &[40]);
    let at = a.op(Op::GroupDecorate, &[&[40][..], &[6; 2000]].concat());
    a.types();
    let error = a.refused();
    assert_eq!(error.kind(), ErrorKind::UnsupportedModule);
    assert!(matches!(error.places().next(), Some((anyhit_base::error::Place::Word(word), _)) if *word > at));
}
