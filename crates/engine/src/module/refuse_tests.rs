//! Modules that are invalid at module scope: each class of mistake once, with the word that the
//! error names.

use pretty_assertions::assert_eq;
use rspirv::spirv::Capability;

use crate::module::assemble::Assembler;
use crate::module::load_tests::sample;
use crate::module::{Opcode, load, load_with};
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_base::input::{InputLimit, InputLimits};

/// Checks the kind, the offset and the message of the error that loading gives.
#[track_caller]
pub(super) fn refused(assembler: &Assembler, offset: usize, message: &str) {
    let error = assembler.refused();
    assert_eq!((word(&error), error.message()), (Some(offset), message));
    assert_eq!(error.kind(), ErrorKind::InvalidModule);
}

/// As [`refused`], for what is beyond a limit.
#[track_caller]
fn beyond(assembler: &Assembler, offset: usize, message: &str) {
    let error = assembler.refused();
    assert_eq!((word(&error), error.message()), (Some(offset), message));
    assert_eq!(error.kind(), ErrorKind::UnsupportedModule);
}

pub(super) fn word(error: &Error) -> Option<usize> {
    match error.places().next() {
        Some((Place::Word(word), _)) => Some(*word),
        _ => None,
    }
}

/// Module scope with the usual types, then what the test adds.
pub(super) fn typed() -> Assembler {
    let mut a = Assembler::new();
    a.types();
    a
}

#[test]
fn no_prefix_of_a_module_loads() {
    let bytes = sample().bytes();
    assert!(load(&bytes).is_ok());
    // The prefix that ends after OpMemoryModel is a valid, empty library.
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
    let at = a.op(Opcode::TypeVoid, &[1000]);
    refused(&a, at + 1, "expected a result id from 1 to 999, found 1000");

    let mut a = Assembler::new();
    let at = a.op(Opcode::TypeVoid, &[0]);
    refused(&a, at + 1, "expected a result id from 1 to 999, found 0");

    let mut a = typed();
    let at = a.op(Opcode::TypeSampler, &[6]);
    refused(&a, at + 1, "%6 is defined twice");
}

#[test]
fn a_module_has_one_memory_model() {
    let mut a = Assembler::bare(10);
    a.op(Opcode::Capability, &[1]);
    refused(&a, 7, "the module has no OpMemoryModel");

    let mut a = Assembler::new();
    let at = a.op(Opcode::MemoryModel, &[0, 1]);
    refused(&a, at, "expected exactly one OpMemoryModel, found a second one");
}

#[test]
fn a_senseless_id_bound_costs_nothing() {
    let mut a = Assembler::new();
    a.words[3] = u32::MAX;
    a.op(Opcode::TypeVoid, &[u32::MAX - 1]);
    assert_eq!(a.loaded().types.len(), 1);
}

#[test]
fn operands_of_types_are_types_defined_before() {
    let mut a = typed();
    let at = a.op(Opcode::TypeVector, &[20, 21, 3]);
    a.op(Opcode::TypeFloat, &[21, 64]);
    refused(&a, at + 2, "OpTypeVector: expected a previously defined id, found %21, which is not defined");

    let mut a = typed();
    let at = a.op(Opcode::TypeVector, &[20, 7, 3]);
    refused(&a, at + 2, "OpTypeVector: expected a scalar type, found %7 (the type vec3)");

    let mut a = typed();
    let at = a.op(Opcode::TypeMatrix, &[20, 6, 3]);
    refused(&a, at + 2, "OpTypeMatrix: expected a vector type, found %6 (the type float)");

    let mut a = typed();
    let at = a.op(Opcode::TypeVector, &[20, 6, 1]);
    refused(&a, at + 3, "OpTypeVector: expected 2, 3 or 4 components, found 1");

    let mut a = typed();
    let at = a.op(Opcode::TypeStruct, &[20, 6, 8]);
    refused(&a, at + 3, "OpTypeStruct: expected the id of a type, found %8 (a constant)");

    let mut a = typed();
    let at = a.op(Opcode::TypeStruct, &[20, 6, 1]);
    refused(&a, at + 3, "OpTypeStruct: expected a type of values, found %1 (the type void)");
}

#[test]
fn a_type_cannot_hold_itself() {
    let mut a = typed();
    let at = a.op(Opcode::TypeStruct, &[20, 6, 20]);
    refused(&a, at + 3, "OpTypeStruct: expected a previously defined id, found %20, which is not defined");
}

#[test]
fn scalar_types_are_declared_once_and_aggregates_any_number_of_times() {
    let mut a = typed();
    a.op(Opcode::TypeStruct, &[20, 6]);
    a.op(Opcode::TypeStruct, &[21, 6]);
    a.op(Opcode::TypePointer, &[22, 12, 6]);
    a.op(Opcode::TypePointer, &[23, 12, 6]);
    assert!(a.load().is_ok());
    let at = a.op(Opcode::TypeFloat, &[24, 32]);
    refused(&a, at, "OpTypeFloat repeats the declaration of a type");
}

#[test]
fn types_are_nested_255_deep_at_most() {
    let mut a = typed();
    a.op(Opcode::TypeStruct, &[100, 6]);
    // %6 is 1 deep, %100 is 2 deep, %353 is 255 deep.
    for id in 101..=353 {
        a.op(Opcode::TypeStruct, &[id, id - 1]);
    }
    assert!(a.load().is_ok());
    let at = a.op(Opcode::TypeStruct, &[354, 353]);
    beyond(&a, at, "256 types nested in types exceed the limit `type-nesting` of 255");
}

#[test]
fn vectors_and_matrices_have_the_sizes_that_the_specification_lists() {
    for count in [0, 1, 5, 7, 8, 16, 3_163_171_322, u32::MAX] {
        let mut a = typed();
        let at = a.op(Opcode::TypeVector, &[20, 6, count]);
        refused(&a, at + 3, &format!("OpTypeVector: expected 2, 3 or 4 components, found {count}"));
        let mut a = typed();
        let at = a.op(Opcode::TypeMatrix, &[20, 7, count]);
        refused(&a, at + 3, &format!("OpTypeMatrix: expected 2, 3 or 4 columns, found {count}"));
    }
    for (capability, counts) in [(Capability::Vector16, &[8, 16][..]), (Capability::LongVectorEXT, &[5, 900])]
    {
        let mut a = Assembler::bare(1000);
        a.op(Opcode::Capability, &[capability as u32]);
        a.op(Opcode::MemoryModel, &[0, 1]);
        a.types();
        for (id, &count) in (20..).zip(counts) {
            a.op(Opcode::TypeVector, &[id, 6, count]);
        }
        assert!(a.load().is_ok(), "{capability:?}");
    }
}

/// A struct of two structs of two structs... has a part for each path.
#[test]
fn types_have_a_limited_number_of_parts() {
    let mut a = typed();
    // 2^n - 1 structs, and a float at the end of each of 2^n paths.
    a.op(Opcode::TypeStruct, &[100, 6, 6]);
    for id in 101..=118 {
        a.op(Opcode::TypeStruct, &[id, id - 1, id - 1]);
    }
    assert!(a.load().is_ok());
    let at = a.op(Opcode::TypeStruct, &[119, 118, 118]);
    beyond(
        &a,
        at,
        "2097151 parts of a type, an array's element counted once exceed the limit `type-parts` of 1048576",
    );
    let limits = InputLimits::default().with(InputLimit::TypeParts, 1 << 21);
    assert!(load_with(&a.bytes(), limits).is_ok());
}

#[test]
fn array_lengths_are_positive_constant_integers() {
    let mut a = typed();
    a.op(Opcode::Constant, &[5, 20, 0]);
    let at = a.op(Opcode::TypeArray, &[21, 6, 20]);
    refused(&a, at + 3, "OpTypeArray: the length %20 is not at least 1");

    let mut a = typed();
    a.op(Opcode::Constant, &[4, 20, u32::MAX]);
    let at = a.op(Opcode::TypeArray, &[21, 6, 20]);
    refused(&a, at + 3, "OpTypeArray: the length %20 is not at least 1");

    let mut a = typed();
    a.op(Opcode::Constant, &[6, 20, 7]);
    let at = a.op(Opcode::TypeArray, &[21, 6, 20]);
    refused(&a, at + 3, "OpTypeArray: expected a constant integer, found %20 (a constant)");

    let mut a = typed();
    let at = a.op(Opcode::TypeArray, &[21, 6, 6]);
    refused(&a, at + 3, "OpTypeArray: expected a constant integer, found %6 (the type float)");
}

#[test]
fn forward_pointers_are_defined_later_with_the_same_storage_class() {
    let mut a = typed();
    let at = a.op(Opcode::TypeForwardPointer, &[20, 5349]);
    a.op(Opcode::TypeStruct, &[21, 20]);
    refused(&a, at + 1, "OpTypeForwardPointer declares %20, but no OpTypePointer defines it");
    let pointer = a.op(Opcode::TypePointer, &[20, 12, 21]);
    refused(&a, pointer + 2, "OpTypePointer: the storage class of %20 differs from its OpTypeForwardPointer");
    a.words[pointer + 2] = 5349;
    assert!(a.load().is_ok());
}

#[test]
fn constants_fit_their_types() {
    let mut a = typed();
    let at = a.op(Opcode::Constant, &[7, 20, 0]);
    refused(&a, at + 1, "OpConstant: expected an integer or float type, found %7 (the type vec3)");

    let mut a = typed();
    let at = a.op(Opcode::ConstantTrue, &[6, 20]);
    refused(&a, at + 1, "OpConstantTrue: expected OpTypeBool, found %6 (the type float)");

    let mut a = typed();
    a.op(Opcode::TypeFloat, &[20, 64]);
    let at = a.op(Opcode::Constant, &[20, 21, 0]);
    refused(&a, at, "OpConstant ends after 4 words where the high word of a 64-bit number is expected");

    let mut a = typed();
    let at = a.op(Opcode::Constant, &[6, 20, 0, 0]);
    refused(&a, at + 4, "OpConstant has 4 words here, but its word count is 5");

    let mut a = typed();
    let at = a.op(Opcode::ConstantNull, &[1, 20]);
    refused(&a, at + 1, "OpConstantNull: expected a type of values, found %1 (the type void)");

    let mut a = typed();
    let at = a.op(Opcode::ConstantNull, &[8, 20]);
    refused(&a, at + 1, "OpConstantNull: expected the id of a type, found %8 (a constant)");
}

#[test]
fn operations_are_not_nested() {
    let mut a = typed();
    let at = a
        .op(Opcode::SpecConstantOp, &[&[5, 20][..], &[u32::from(Opcode::SpecConstantOp.0); 60_000]].concat());
    refused(&a, at + 3, "OpSpecConstantOp cannot compute an OpSpecConstantOp");
}

#[test]
fn constituents_fit_their_composites() {
    let mut a = typed();
    a.op(Opcode::Constant, &[6, 20, 0]);
    let at = a.op(Opcode::ConstantComposite, &[7, 21, 20, 20]);
    refused(&a, at, "OpConstantComposite: expected 3 constituents, found 2");

    let mut a = typed();
    a.op(Opcode::Constant, &[6, 20, 0]);
    let at = a.op(Opcode::ConstantComposite, &[7, 21, 20, 8, 20]);
    refused(&a, at + 4, "OpConstantComposite: expected a constant of type float, found %8 (a constant)");

    let mut a = typed();
    let at = a.op(Opcode::ConstantComposite, &[7, 21, 6, 6, 6]);
    refused(&a, at + 3, "OpConstantComposite: expected a constant, found %6 (the type float)");

    let mut a = typed();
    let at = a.op(Opcode::ConstantComposite, &[6, 21, 8]);
    refused(&a, at + 1, "OpConstantComposite: expected a composite type, found %6 (the type float)");
}

#[test]
fn variables_have_pointer_types_of_their_storage_class() {
    let mut a = typed();
    let at = a.op(Opcode::Variable, &[6, 20, 12]);
    refused(&a, at + 1, "OpVariable: expected a pointer type, found %6 (the type float)");

    let mut a = typed();
    a.op(Opcode::TypePointer, &[20, 12, 6]);
    let at = a.op(Opcode::Variable, &[20, 21, 6]);
    let error = a.refused();
    assert_eq!(word(&error), Some(at + 3));

    let mut a = typed();
    a.op(Opcode::TypePointer, &[20, 7, 6]);
    let at = a.op(Opcode::Variable, &[20, 21, 7]);
    refused(&a, at + 3, "OpVariable of storage class Function is not allowed outside a function");

    let mut a = typed();
    a.op(Opcode::TypePointer, &[20, 6, 6]);
    let at = a.op(Opcode::Variable, &[20, 21, 6, 8]);
    refused(&a, at + 4, "OpVariable: expected a constant of the variable's type, found %8 (a constant)");

    // %21 is a float, %22 a pointer to one.
    let mut a = typed();
    a.op(Opcode::TypePointer, &[20, 6, 6]);
    a.op(Opcode::Variable, &[20, 21, 6]);
    a.op(Opcode::TypePointer, &[22, 6, 20]);
    a.op(Opcode::Variable, &[22, 23, 6, 21]);
    let at = a.op(Opcode::Variable, &[20, 24, 6, 21]);
    refused(
        &a,
        at + 4,
        "OpVariable: expected a variable that is a value of the variable's type, found %21 (a variable)",
    );
}

#[test]
fn decorations_have_targets() {
    let mut a = Assembler::new();
    let at = a.op(Opcode::Decorate, &[20, 33, 0]);
    refused(&a, at + 1, "%20 is decorated, but nothing defines it");

    let mut a = Assembler::new();
    let at = a.op(Opcode::Decorate, &[20, 33]);
    refused(&a, at, "OpDecorate ends after 3 words where an operand (LiteralInteger) is expected");

    let mut a = Assembler::new();
    let at = a.op(Opcode::MemberDecorate, &[20, 2, 35, 0]);
    a.types();
    a.op(Opcode::TypeStruct, &[20, 6, 6]);
    refused(&a, at + 2, "member 2 of %20 is decorated, which has 2 members");

    let mut a = Assembler::new();
    let at = a.op(Opcode::MemberDecorate, &[6, 0, 35, 0]);
    a.types();
    refused(&a, at + 1, "a member of %6 is decorated, but the id is not a struct");

    let mut a = Assembler::new();
    let at = a.op(Opcode::GroupDecorate, &[6, 7]);
    a.types();
    refused(&a, at + 2, "expected the id of an OpDecorationGroup, found %6");
}

#[test]
fn entry_points_are_functions_with_bodies() {
    let mut a = Assembler::new();
    let at = a.with_string(Opcode::EntryPoint, &[5313, 6], "main", &[]);
    a.types();
    refused(&a, at + 2, "OpEntryPoint: expected the id of a function, found %6");

    let mut a = Assembler::new();
    let at = a.with_string(Opcode::EntryPoint, &[5313, 20], "main", &[]);
    a.types();
    a.op(Opcode::Function, &[1, 20, 0, 2]);
    a.op(Opcode::FunctionEnd, &[]);
    refused(&a, at + 2, "entry point `main` has no body");

    let mut a = Assembler::new();
    let at = a.with_string(Opcode::EntryPoint, &[5313, 20], "main", &[8]);
    a.types().function(20, 21, |a| {
        a.op(Opcode::Return, &[]);
    });
    refused(&a, at + 5, "OpEntryPoint: expected the id of a variable of module scope, found %8");

    let mut a = Assembler::new();
    a.with_string(Opcode::EntryPoint, &[5313, 20], "main", &[]);
    let at = a.with_string(Opcode::EntryPoint, &[5313, 20], "main", &[]);
    a.types().function(20, 21, |a| {
        a.op(Opcode::Return, &[]);
    });
    refused(&a, at, "a second entry point `main` of RayGenerationKHR");

    let mut a = Assembler::new();
    let at = a.op(Opcode::ExecutionMode, &[20, 17, 1, 1, 1]);
    refused(&a, at + 1, "an execution mode's target must be an entry point, found %20");
}
