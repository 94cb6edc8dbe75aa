//! Modules that load, with what is then found in them.

use pretty_assertions::assert_eq;
use rspirv::spirv::Op;

use crate::module::assemble::Assembler;
use crate::module::constant::ConstantValue;
use crate::module::interface::Stage;
use crate::module::ty::{MatrixLayout, Type};
use crate::module::{Definition, Id, load};

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
