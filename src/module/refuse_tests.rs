//! Modules that must not load: each class of mistake once, with the word that the error names.

use pretty_assertions::assert_eq;
use rspirv::spirv::Op;

use crate::error::{Error, ErrorKind, Place};
use crate::module::assemble::Assembler;
use crate::module::load;
use crate::module::load_tests::sample;

/// The kind, the first place's word, and the message of a refusal.
#[track_caller]
fn refused(assembler: &Assembler, offset: usize, message: &str) {
    let error = assembler.refused();
    assert_eq!((word(&error), error.message()), (Some(offset), message));
    assert_eq!(error.kind(), ErrorKind::InvalidModule);
}

fn word(error: &Error) -> Option<usize> {
    match error.places().next() {
        Some((Place::Word(word), _)) => Some(*word),
        _ => None,
    }
}

/// Module scope with the usual types, then what the test adds.
fn typed() -> Assembler {
    let mut a = Assembler::new();
    a.types();
    a
}

#[test]
fn no_prefix_of_a_module_loads() {
    let bytes = sample().bytes();
    assert!(load(&bytes).is_ok());
    // Behind OpMemoryModel, and before the entry point, it is a library of nothing: valid.
    let library = 4 * 22;
    assert!(load(&bytes[..library]).unwrap().entry_points.is_empty());
    for length in (0..bytes.len()).filter(|length| *length != library) {
        let error = load(&bytes[..length]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidModule, "{length} bytes");
        assert!(word(&error).is_some_and(|word| word <= length.div_ceil(4)), "{length} bytes: {error}");
    }
}

#[test]
fn results_are_checked() {
    let mut a = Assembler::new();
    let at = a.op(Op::TypeVoid, &[1000]);
    refused(&a, at + 1, "expected a result id from 1 to 999, found 1000");

    let mut a = Assembler::new();
    let at = a.op(Op::TypeVoid, &[0]);
    refused(&a, at + 1, "expected a result id from 1 to 999, found 0");

    let mut a = typed();
    let at = a.op(Op::TypeSampler, &[6]);
    refused(&a, at + 1, "%6 is defined twice");
}

#[test]
fn a_module_has_one_memory_model() {
    let mut a = Assembler::bare(10);
    a.op(Op::Capability, &[1]);
    refused(&a, 7, "the module has no OpMemoryModel");

    let mut a = Assembler::new();
    let at = a.op(Op::MemoryModel, &[0, 1]);
    refused(&a, at, "OpMemoryModel stands twice; exactly one is expected");
}

#[test]
fn a_senseless_id_bound_costs_nothing() {
    let mut a = Assembler::new();
    a.words[3] = u32::MAX;
    a.op(Op::TypeVoid, &[u32::MAX - 1]);
    assert_eq!(a.loaded().types.len(), 1);
}

#[test]
fn operands_of_types_are_types_defined_before() {
    let mut a = typed();
    let at = a.op(Op::TypeVector, &[20, 21, 3]);
    a.op(Op::TypeFloat, &[21, 64]);
    refused(&a, at + 2, "OpTypeVector: expected an id defined before, found %21, which nothing defines");

    let mut a = typed();
    let at = a.op(Op::TypeVector, &[20, 7, 3]);
    refused(&a, at + 2, "OpTypeVector: expected a scalar type, found %7 (the type vec3)");

    let mut a = typed();
    let at = a.op(Op::TypeMatrix, &[20, 6, 3]);
    refused(&a, at + 2, "OpTypeMatrix: expected a vector type, found %6 (the type float)");

    let mut a = typed();
    let at = a.op(Op::TypeVector, &[20, 6, 1]);
    refused(&a, at + 3, "OpTypeVector: expected a count of at least 2, found 1");

    let mut a = typed();
    let at = a.op(Op::TypeStruct, &[20, 6, 8]);
    refused(&a, at + 3, "OpTypeStruct: expected the id of a type, found %8 (a constant)");

    let mut a = typed();
    let at = a.op(Op::TypeStruct, &[20, 6, 1]);
    refused(&a, at + 3, "OpTypeStruct: expected a type that values can have, found %1 (the type void)");
}

#[test]
fn a_type_cannot_hold_itself() {
    let mut a = typed();
    let at = a.op(Op::TypeStruct, &[20, 6, 20]);
    refused(&a, at + 3, "OpTypeStruct: expected an id defined before, found %20, which nothing defines");
}

#[test]
fn scalar_types_are_declared_once_and_aggregates_as_often_as_one_likes() {
    let mut a = typed();
    a.op(Op::TypeStruct, &[20, 6]);
    a.op(Op::TypeStruct, &[21, 6]);
    a.op(Op::TypePointer, &[22, 12, 6]);
    a.op(Op::TypePointer, &[23, 12, 6]);
    assert!(a.load().is_ok());
    let at = a.op(Op::TypeFloat, &[24, 32]);
    refused(&a, at, "OpTypeFloat declares a type that exists already");
}

#[test]
fn types_are_nested_255_deep_at_most() {
    let mut a = typed();
    a.op(Op::TypeStruct, &[100, 6]);
    // %6 is 1 deep, %100 is 2 deep, %353 is 255 deep.
    for id in 101..=353 {
        a.op(Op::TypeStruct, &[id, id - 1]);
    }
    assert!(a.load().is_ok());
    let at = a.op(Op::TypeStruct, &[354, 353]);
    refused(&a, at, "OpTypeStruct: types are nested deeper than 255");
}

#[test]
fn array_lengths_are_positive_constant_integers() {
    let mut a = typed();
    a.op(Op::Constant, &[5, 20, 0]);
    let at = a.op(Op::TypeArray, &[21, 6, 20]);
    refused(&a, at + 3, "OpTypeArray: the length %20 is not at least 1");

    let mut a = typed();
    a.op(Op::Constant, &[4, 20, u32::MAX]);
    let at = a.op(Op::TypeArray, &[21, 6, 20]);
    refused(&a, at + 3, "OpTypeArray: the length %20 is not at least 1");

    let mut a = typed();
    a.op(Op::Constant, &[6, 20, 7]);
    let at = a.op(Op::TypeArray, &[21, 6, 20]);
    refused(&a, at + 3, "OpTypeArray: expected a constant integer, found %20 (a constant)");

    let mut a = typed();
    let at = a.op(Op::TypeArray, &[21, 6, 6]);
    refused(&a, at + 3, "OpTypeArray: expected a constant integer, found %6 (the type float)");
}

#[test]
fn forward_pointers_are_defined_later_with_the_same_storage_class() {
    let mut a = typed();
    let at = a.op(Op::TypeForwardPointer, &[20, 5349]);
    a.op(Op::TypeStruct, &[21, 20]);
    refused(&a, at + 1, "OpTypeForwardPointer announces %20, but no OpTypePointer defines it");
    let pointer = a.op(Op::TypePointer, &[20, 12, 21]);
    refused(&a, pointer + 2, "OpTypePointer: the storage class of %20 differs from its OpTypeForwardPointer");
    a.words[pointer + 2] = 5349;
    assert!(a.load().is_ok());
}

#[test]
fn constants_fit_their_types() {
    let mut a = typed();
    let at = a.op(Op::Constant, &[7, 20, 0]);
    refused(&a, at + 1, "OpConstant: expected an integer or float type, found %7 (the type vec3)");

    let mut a = typed();
    let at = a.op(Op::ConstantTrue, &[6, 20]);
    refused(&a, at + 1, "OpConstantTrue: expected OpTypeBool, found %6 (the type float)");

    let mut a = typed();
    a.op(Op::TypeFloat, &[20, 64]);
    let at = a.op(Op::Constant, &[20, 21, 0]);
    refused(&a, at, "OpConstant ends after 4 words where the high word of a 64-bit number is expected");

    let mut a = typed();
    let at = a.op(Op::Constant, &[6, 20, 0, 0]);
    refused(&a, at + 4, "OpConstant takes 4 words here, but its word count is 5");

    let mut a = typed();
    let at = a.op(Op::ConstantNull, &[1, 20]);
    refused(&a, at + 1, "OpConstantNull: expected a type that values can have, found %1 (the type void)");

    let mut a = typed();
    let at = a.op(Op::ConstantNull, &[8, 20]);
    refused(&a, at + 1, "OpConstantNull: expected the id of a type, found %8 (a constant)");
}

#[test]
fn operations_are_not_nested() {
    let mut a = typed();
    let at = a.op(Op::SpecConstantOp, &[&[5, 20][..], &[Op::SpecConstantOp as u32; 60_000]].concat());
    refused(&a, at + 3, "OpSpecConstantOp cannot compute an OpSpecConstantOp");
}

#[test]
fn constituents_fit_their_composites() {
    let mut a = typed();
    a.op(Op::Constant, &[6, 20, 0]);
    let at = a.op(Op::ConstantComposite, &[7, 21, 20, 20]);
    refused(&a, at, "OpConstantComposite: expected 3 constituents, found 2");

    let mut a = typed();
    a.op(Op::Constant, &[6, 20, 0]);
    let at = a.op(Op::ConstantComposite, &[7, 21, 20, 8, 20]);
    refused(&a, at + 4, "OpConstantComposite: expected a constant of type float, found %8 (a constant)");

    let mut a = typed();
    let at = a.op(Op::ConstantComposite, &[7, 21, 6, 6, 6]);
    refused(&a, at + 3, "OpConstantComposite: expected a constant, found %6 (the type float)");

    let mut a = typed();
    let at = a.op(Op::ConstantComposite, &[6, 21, 8]);
    refused(&a, at + 1, "OpConstantComposite: expected a composite type, found %6 (the type float)");
}

#[test]
fn variables_have_pointer_types_of_their_storage_class() {
    let mut a = typed();
    let at = a.op(Op::Variable, &[6, 20, 12]);
    refused(&a, at + 1, "OpVariable: expected a pointer type, found %6 (the type float)");

    let mut a = typed();
    a.op(Op::TypePointer, &[20, 12, 6]);
    let at = a.op(Op::Variable, &[20, 21, 6]);
    let error = a.refused();
    assert_eq!(word(&error), Some(at + 3));

    let mut a = typed();
    a.op(Op::TypePointer, &[20, 7, 6]);
    let at = a.op(Op::Variable, &[20, 21, 7]);
    refused(&a, at + 3, "OpVariable of storage class Function stands outside a function");

    let mut a = typed();
    a.op(Op::TypePointer, &[20, 6, 6]);
    let at = a.op(Op::Variable, &[20, 21, 6, 8]);
    refused(&a, at + 4, "OpVariable: expected a constant of the variable's type, found %8 (a constant)");
}

#[test]
fn decorations_have_targets() {
    let mut a = Assembler::new();
    let at = a.op(Op::Decorate, &[20, 33, 0]);
    refused(&a, at + 1, "%20 is decorated, but nothing defines it");

    let mut a = Assembler::new();
    let at = a.op(Op::Decorate, &[20, 33]);
    refused(&a, at, "OpDecorate ends after 3 words where an operand (LiteralInteger) is expected");

    let mut a = Assembler::new();
    let at = a.op(Op::MemberDecorate, &[20, 2, 35, 0]);
    a.types();
    a.op(Op::TypeStruct, &[20, 6, 6]);
    refused(&a, at + 2, "member 2 of %20 is decorated, which has 2 members");

    let mut a = Assembler::new();
    let at = a.op(Op::MemberDecorate, &[6, 0, 35, 0]);
    a.types();
    refused(&a, at + 1, "a member of %6 is decorated, which is no struct");

    let mut a = Assembler::new();
    let at = a.op(Op::GroupDecorate, &[6, 7]);
    a.types();
    refused(&a, at + 2, "expected the id of an OpDecorationGroup, found %6");
}

#[test]
fn entry_points_are_functions_with_bodies() {
    let mut a = Assembler::new();
    let at = a.with_string(Op::EntryPoint, &[5313, 6], "main", &[]);
    a.types();
    refused(&a, at + 2, "OpEntryPoint: expected the id of a function, found %6");

    let mut a = Assembler::new();
    let at = a.with_string(Op::EntryPoint, &[5313, 20], "main", &[]);
    a.types();
    a.op(Op::Function, &[1, 20, 0, 2]);
    a.op(Op::FunctionEnd, &[]);
    refused(&a, at + 2, "entry point `main` has no body");

    let mut a = Assembler::new();
    let at = a.with_string(Op::EntryPoint, &[5313, 20], "main", &[8]);
    a.types().function(20, 21, |a| {
        a.op(Op::Return, &[]);
    });
    refused(&a, at + 5, "OpEntryPoint: expected the id of a variable of module scope, found %8");

    let mut a = Assembler::new();
    a.with_string(Op::EntryPoint, &[5313, 20], "main", &[]);
    let at = a.with_string(Op::EntryPoint, &[5313, 20], "main", &[]);
    a.types().function(20, 21, |a| {
        a.op(Op::Return, &[]);
    });
    refused(&a, at, "a second entry point `main` of RayGenerationKHR");

    let mut a = Assembler::new();
    let at = a.op(Op::ExecutionMode, &[20, 17, 1, 1, 1]);
    refused(&a, at + 1, "an execution mode's target must be an entry point, found %20");
}

#[test]
fn functions_are_blocks_between_their_ends() {
    let mut a = typed();
    a.op(Op::Function, &[1, 20, 0, 2]);
    refused(&a, a.words.len(), "the module ends before the OpFunctionEnd of %20");

    let mut a = typed();
    a.op(Op::Function, &[1, 20, 0, 2]);
    let at = a.op(Op::Return, &[]);
    refused(&a, at, "expected OpFunctionParameter, OpLabel or OpFunctionEnd, found OpReturn");

    let mut a = typed();
    a.op(Op::Function, &[1, 20, 0, 2]);
    a.op(Op::Label, &[21]);
    let at = a.op(Op::FunctionEnd, &[]);
    refused(&a, at, "block %21 has no terminator before OpFunctionEnd");

    let mut a = typed();
    a.op(Op::Function, &[1, 20, 0, 2]);
    a.op(Op::Label, &[21]);
    let at = a.op(Op::Label, &[22]);
    refused(&a, at, "block %21 has no terminator before OpLabel");

    let mut a = typed();
    a.op(Op::Function, &[1, 20, 0, 2]);
    a.op(Op::Label, &[21]);
    a.op(Op::Return, &[]);
    let at = a.op(Op::Return, &[]);
    refused(&a, at, "expected OpLabel or OpFunctionEnd, found OpReturn");

    let mut a = typed();
    a.op(Op::Function, &[1, 20, 0, 2]);
    let at = a.op(Op::Function, &[1, 21, 0, 2]);
    refused(&a, at, "OpFunction stands before the OpFunctionEnd of the last one");

    let mut a = typed();
    a.op(Op::Function, &[1, 20, 0, 2]);
    a.op(Op::Label, &[21]);
    let at = a.op(Op::TypeFloat, &[22, 64]);
    refused(&a, at, "OpTypeFloat stands inside a function");

    let mut a = typed();
    let at = a.op(Op::FAdd, &[6, 20, 8, 8]);
    refused(&a, at, "OpFAdd stands outside a function");
}

#[test]
fn functions_agree_with_their_types() {
    let mut a = typed();
    let at = a.op(Op::Function, &[6, 20, 0, 2]);
    let error = a.refused();
    assert_eq!(word(&error), Some(at + 4));
    assert!(error.message().contains("a function type with the same return type"), "{error}");

    let mut a = typed();
    a.op(Op::TypeFunction, &[20, 1, 6]);
    a.op(Op::Function, &[1, 21, 0, 20]);
    let at = a.op(Op::Label, &[22]);
    refused(&a, at, "%21: expected 1 OpFunctionParameter, found 0 before OpLabel");

    let mut a = typed();
    a.op(Op::TypeFunction, &[20, 1, 6]);
    a.op(Op::Function, &[1, 21, 0, 20]);
    let at = a.op(Op::FunctionParameter, &[5, 22]);
    refused(
        &a,
        at + 1,
        "OpFunctionParameter: expected float, as the function's type says, found %5 (the type uint)",
    );

    let mut a = typed();
    a.op(Op::Function, &[1, 21, 0, 2]);
    let at = a.op(Op::FunctionParameter, &[6, 22]);
    refused(&a, at, "OpFunctionParameter: the function's type has 0 parameters only");
}

/// A function whose one block holds what the test writes; the offset of that.
fn body(write: impl FnOnce(&mut Assembler) -> usize) -> (Assembler, usize) {
    let mut a = typed();
    a.op(Op::Constant, &[6, 9, 0]);
    a.op(Op::ConstantTrue, &[3, 10]);
    a.op(Op::TypePointer, &[11, 7, 7]);
    a.op(Op::ConstantNull, &[7, 12]);
    let mut at = 0;
    a.function(50, 51, |a| {
        at = write(a);
        a.op(Op::Return, &[]);
    });
    (a, at)
}

#[test]
fn ids_in_functions_are_defined_in_reach() {
    let (a, at) = body(|a| a.op(Op::FAdd, &[6, 60, 9, 99]));
    refused(&a, at + 4, "OpFAdd names %99, but nothing defines it");

    let (a, at) = body(|a| a.op(Op::FAdd, &[9, 60, 9, 9]));
    refused(&a, at + 1, "OpFAdd: expected the id of a type, found %9 (a constant)");

    let (a, at) = body(|a| a.op(Op::FAdd, &[6, 60, 9, 60]));
    refused(&a, at + 4, "OpFAdd: expected a value defined before, found %60 (a result)");

    let (a, at) = body(|a| a.op(Op::FAdd, &[6, 60, 9, 51]));
    refused(&a, at + 4, "OpFAdd: expected a value, found %51 (a label)");

    let (mut a, _) = body(|a| a.op(Op::FAdd, &[6, 60, 9, 9]));
    let mut at = 0;
    a.function(70, 71, |a| {
        at = a.op(Op::FAdd, &[6, 72, 9, 60]);
        a.op(Op::Return, &[]);
    });
    refused(&a, at + 4, "OpFAdd: expected a value of the same function, found %60 (a result)");

    let (a, at) = body(|a| a.op(Op::ExtInst, &[6, 60, 9, 13, 9]));
    refused(&a, at + 3, "OpExtInst: expected an instruction set imported before, found %9 (a constant)");

    let (a, at) = body(|a| a.op(Op::FAdd, &[6]));
    refused(&a, at, "OpFAdd ends before its result id");
}

#[test]
fn branches_lead_to_blocks_of_their_function() {
    let branch = |op: Op, operands: &[u32]| {
        let mut a = typed();
        a.op(Op::ConstantTrue, &[3, 10]);
        a.op(Op::Function, &[1, 50, 0, 2]);
        a.op(Op::Label, &[51]);
        let at = a.op(op, operands);
        a.op(Op::Label, &[52]);
        a.op(Op::Return, &[]);
        a.op(Op::FunctionEnd, &[]);
        a.function(60, 61, |a| {
            a.op(Op::Return, &[]);
        });
        (a, at)
    };
    assert!(branch(Op::Branch, &[52]).0.load().is_ok());
    let (a, at) = branch(Op::Branch, &[61]);
    refused(&a, at + 1, "OpBranch: expected a label of the same function, found %61 (a label)");
    let (a, at) = branch(Op::Branch, &[8]);
    refused(&a, at + 1, "OpBranch: expected a label of the same function, found %8 (a constant)");
    let (a, at) = branch(Op::Branch, &[99]);
    refused(&a, at + 1, "OpBranch names %99, but nothing defines it");
    let (a, at) = branch(Op::BranchConditional, &[10, 52, 8]);
    refused(&a, at + 3, "OpBranchConditional: expected a label of the same function, found %8 (a constant)");
    let (a, at) = branch(Op::Switch, &[8, 52, 0, 7]);
    refused(&a, at + 4, "OpSwitch: expected a label of the same function, found %7 (the type vec3)");
    let (a, at) = branch(Op::Branch, &[51]);
    refused(&a, at, "a branch leads to %51, the first block of its function");
}

#[test]
fn merges_and_phis_stand_where_they_must() {
    let (a, at) = body(|a| {
        let at = a.op(Op::SelectionMerge, &[51, 0]);
        a.op(Op::FAdd, &[6, 60, 9, 9]);
        at
    });
    refused(&a, at, "OpSelectionMerge must stand right before the terminator of block %51");

    let phi = |operands: &[u32], before: bool| {
        let mut a = typed();
        a.op(Op::ConstantTrue, &[3, 10]);
        a.op(Op::Function, &[1, 50, 0, 2]);
        a.op(Op::Label, &[51]);
        a.op(Op::SelectionMerge, &[53, 0]);
        a.op(Op::BranchConditional, &[10, 52, 53]);
        a.op(Op::Label, &[52]);
        a.op(Op::Branch, &[53]);
        a.op(Op::Label, &[53]);
        if before {
            a.op(Op::IAdd, &[5, 54, 8, 8]);
        }
        let at = a.op(Op::Phi, &[&[5, 55], operands].concat());
        a.op(Op::Return, &[]);
        a.op(Op::FunctionEnd, &[]);
        (a, at)
    };
    assert!(phi(&[8, 51, 8, 52], false).0.load().is_ok());
    let (a, at) = phi(&[8, 51, 8, 52], true);
    refused(&a, at, "OpPhi stands behind another instruction of block %53");
    let (a, at) = phi(&[8, 51], false);
    refused(&a, at, "OpPhi has 1 parents, but 2 blocks branch to its block");
    let (a, at) = phi(&[8, 51, 8, 51], false);
    refused(&a, at + 6, "OpPhi names the block %51 twice");
    let (a, at) = phi(&[8, 51, 8, 53], false);
    refused(&a, at + 6, "OpPhi names %53, which does not branch to its block");
    let (a, at) = phi(&[8, 51, 8, 8], false);
    refused(&a, at + 6, "OpPhi: expected a label of the same function, found %8 (a constant)");
    let (a, at) = phi(&[8, 51, 8], false);
    refused(&a, at, "OpPhi ends after 6 words where an operand (IdRef) is expected");
}

#[test]
fn accesses_stay_within_their_types() {
    let (a, at) = body(|a| a.op(Op::CompositeExtract, &[6, 60, 12, 3]));
    refused(&a, at + 4, "OpCompositeExtract: index 3 is out of range: vec3 has 3 parts");

    let (a, at) = body(|a| a.op(Op::CompositeExtract, &[6, 60, 12, 1, 0]));
    refused(&a, at + 5, "OpCompositeExtract: an index into float, which has no parts");

    let (a, at) = body(|a| a.op(Op::CompositeExtract, &[5, 60, 12, 1]));
    refused(&a, at + 1, "OpCompositeExtract: the type float is expected, found uint");

    let (a, at) = body(|a| a.op(Op::CompositeInsert, &[7, 60, 8, 12, 1]));
    refused(&a, at + 3, "OpCompositeInsert: the type float is expected, found uint");

    let (a, at) = body(|a| {
        a.op(Op::Variable, &[11, 60, 7]);
        a.op(Op::Load, &[6, 61, 60])
    });
    refused(&a, at + 1, "OpLoad: the type vec3 is expected, found float");

    let (a, at) = body(|a| {
        a.op(Op::Variable, &[11, 60, 7]);
        a.op(Op::Store, &[60, 9])
    });
    refused(&a, at + 2, "OpStore: the type vec3 is expected, found float");

    let (a, at) = body(|a| a.op(Op::Load, &[6, 61, 12]));
    refused(&a, at + 3, "OpLoad: expected a pointer, found %12 (a constant)");

    let mut a = typed();
    a.op(Op::TypeStruct, &[20, 6, 7]);
    a.op(Op::TypePointer, &[21, 6, 20]);
    a.op(Op::TypePointer, &[22, 6, 6]);
    a.op(Op::Variable, &[21, 23, 6]);
    a.op(Op::Constant, &[4, 24, u32::MAX]);
    let mut at = 0;
    a.function(50, 51, |a| {
        at = a.op(Op::AccessChain, &[22, 60, 23, 24]);
        a.op(Op::Return, &[]);
    });
    refused(&a, at + 4, "OpAccessChain: index -1 is out of range: struct %20 has 2 parts");
}

#[test]
fn local_variables_stand_in_the_first_block() {
    let (a, at) = body(|a| a.op(Op::Variable, &[11, 60, 6]));
    let error = a.refused();
    assert_eq!(word(&error), Some(at + 3));
    assert_eq!(error.message(), "OpVariable inside a function must have the storage class Function");

    let (a, at) = body(|a| {
        a.op(Op::Branch, &[60]);
        a.op(Op::Label, &[60]);
        a.op(Op::Variable, &[11, 61, 7])
    });
    refused(&a, at, "OpVariable stands behind the function's first block");
}

#[test]
fn calls_fit_their_functions_and_form_no_circle() {
    let call = |operands: &[u32]| {
        let mut a = Assembler::new();
        a.with_string(Op::EntryPoint, &[5313, 50], "main", &[]);
        a.types();
        a.op(Op::TypeFunction, &[20, 6, 6]);
        a.op(Op::Constant, &[6, 21, 0]);
        let mut at = 0;
        a.function(50, 51, |a| {
            at = a.op(Op::FunctionCall, operands);
            a.op(Op::Return, &[]);
        });
        a.op(Op::Function, &[6, 60, 0, 20]);
        a.op(Op::FunctionParameter, &[6, 61]);
        a.op(Op::Label, &[62]);
        let back = a.op(Op::FunctionCall, &[6, 63, 60, 61]);
        a.op(Op::ReturnValue, &[63]);
        a.op(Op::FunctionEnd, &[]);
        (a, at, back)
    };
    let (a, _, back) = call(&[6, 52, 60, 21]);
    refused(&a, back + 3, "OpFunctionCall closes a circle of calls at %60 (a function)");
    let (a, at, _) = call(&[6, 52, 21, 21]);
    refused(&a, at + 3, "OpFunctionCall: expected a function, found %21 (a constant)");
    let (a, at, _) = call(&[6, 52, 60]);
    refused(&a, at, "OpFunctionCall: %60 takes 1 arguments, found 0");
    let (a, at, _) = call(&[6, 52, 60, 8]);
    refused(&a, at + 4, "OpFunctionCall: expected an argument of type float, found %8 (a constant)");
    let (a, at, _) = call(&[5, 52, 60, 21]);
    refused(
        &a,
        at + 1,
        "OpFunctionCall: expected the type that the function returns (float), found %5 (the type uint)",
    );
    let (a, at, _) = call(&[1, 52, 50]);
    refused(&a, at + 3, "OpFunctionCall calls %50, which is an entry point");
}

#[test]
fn a_circle_that_no_entry_point_reaches_is_left_alone() {
    let mut a = typed();
    a.function(50, 51, |a| {
        a.op(Op::FunctionCall, &[1, 52, 50]);
        a.op(Op::Return, &[]);
    });
    assert!(a.load().is_ok());
}
