//! Modules with invalid functions: each class of mistake once, with the word that the error names.

use crate::module::Opcode;

use crate::module::assemble::Assembler;
use crate::module::refuse_tests::{refused, typed, word};

#[test]
fn functions_are_blocks_between_their_ends() {
    let mut a = typed();
    a.op(Opcode::Function, &[1, 20, 0, 2]);
    refused(&a, a.words.len(), "the module ends before the OpFunctionEnd of %20");

    let mut a = typed();
    a.op(Opcode::Function, &[1, 20, 0, 2]);
    let at = a.op(Opcode::Return, &[]);
    refused(&a, at, "expected OpFunctionParameter, OpLabel or OpFunctionEnd, found OpReturn");

    let mut a = typed();
    a.op(Opcode::Function, &[1, 20, 0, 2]);
    a.op(Opcode::Label, &[21]);
    let at = a.op(Opcode::FunctionEnd, &[]);
    refused(&a, at, "block %21 has no terminator before OpFunctionEnd");

    let mut a = typed();
    a.op(Opcode::Function, &[1, 20, 0, 2]);
    a.op(Opcode::Label, &[21]);
    let at = a.op(Opcode::Label, &[22]);
    refused(&a, at, "block %21 has no terminator before OpLabel");

    let mut a = typed();
    a.op(Opcode::Function, &[1, 20, 0, 2]);
    a.op(Opcode::Label, &[21]);
    a.op(Opcode::Return, &[]);
    let at = a.op(Opcode::Return, &[]);
    refused(&a, at, "expected OpLabel or OpFunctionEnd, found OpReturn");

    let mut a = typed();
    a.op(Opcode::Function, &[1, 20, 0, 2]);
    let at = a.op(Opcode::Function, &[1, 21, 0, 2]);
    refused(&a, at, "OpFunction precedes the OpFunctionEnd of the previous function");

    let mut a = typed();
    a.op(Opcode::Function, &[1, 20, 0, 2]);
    a.op(Opcode::Label, &[21]);
    let at = a.op(Opcode::TypeFloat, &[22, 64]);
    refused(&a, at, "OpTypeFloat is not allowed inside a function");

    let mut a = typed();
    let at = a.op(Opcode::FAdd, &[6, 20, 8, 8]);
    refused(&a, at, "OpFAdd is not allowed outside a function");
}

#[test]
fn functions_agree_with_their_types() {
    let mut a = typed();
    let at = a.op(Opcode::Function, &[6, 20, 0, 2]);
    let error = a.refused();
    assert_eq!(word(&error), Some(at + 4));
    assert!(error.message().contains("a function type with the same return type"), "{error}");

    let mut a = typed();
    a.op(Opcode::TypeFunction, &[20, 1, 6]);
    a.op(Opcode::Function, &[1, 21, 0, 20]);
    let at = a.op(Opcode::Label, &[22]);
    refused(&a, at, "%21: expected 1 OpFunctionParameter, found 0 before OpLabel");

    let mut a = typed();
    a.op(Opcode::TypeFunction, &[20, 1, 6]);
    a.op(Opcode::Function, &[1, 21, 0, 20]);
    let at = a.op(Opcode::FunctionParameter, &[5, 22]);
    refused(
        &a,
        at + 1,
        "OpFunctionParameter: expected float, as in the function's type, found %5 (the type uint)",
    );

    let mut a = typed();
    a.op(Opcode::Function, &[1, 21, 0, 2]);
    let at = a.op(Opcode::FunctionParameter, &[6, 22]);
    refused(&a, at, "OpFunctionParameter: the function's type has 0 parameters only");
}

/// A function with one block of the test's instructions, and their offset.
fn body(write: impl FnOnce(&mut Assembler) -> usize) -> (Assembler, usize) {
    let mut a = typed();
    a.op(Opcode::Constant, &[6, 9, 0]);
    a.op(Opcode::ConstantTrue, &[3, 10]);
    a.op(Opcode::TypePointer, &[11, 7, 7]);
    a.op(Opcode::ConstantNull, &[7, 12]);
    let mut at = 0;
    a.function(50, 51, |a| {
        at = write(a);
        a.op(Opcode::Return, &[]);
    });
    (a, at)
}

#[test]
fn ids_in_functions_are_in_scope() {
    let (a, at) = body(|a| a.op(Opcode::FAdd, &[6, 60, 9, 99]));
    refused(&a, at + 4, "OpFAdd names %99, but nothing defines it");

    let (a, at) = body(|a| a.op(Opcode::FAdd, &[9, 60, 9, 9]));
    refused(&a, at + 1, "OpFAdd: expected the id of a type, found %9 (a constant)");

    let (a, at) = body(|a| a.op(Opcode::FAdd, &[6, 60, 9, 60]));
    refused(&a, at + 4, "OpFAdd: expected a previously defined value, found %60 (a result)");

    let (a, at) = body(|a| a.op(Opcode::FAdd, &[6, 60, 9, 51]));
    refused(&a, at + 4, "OpFAdd: expected a value, found %51 (a label)");

    let (mut a, _) = body(|a| a.op(Opcode::FAdd, &[6, 60, 9, 9]));
    let mut at = 0;
    a.function(70, 71, |a| {
        at = a.op(Opcode::FAdd, &[6, 72, 9, 60]);
        a.op(Opcode::Return, &[]);
    });
    refused(&a, at + 4, "OpFAdd: expected a value of the same function, found %60 (a result)");

    let (a, at) = body(|a| a.op(Opcode::ExtInst, &[6, 60, 9, 13, 9]));
    refused(&a, at + 3, "OpExtInst: expected a previously imported instruction set, found %9 (a constant)");

    let (a, at) = body(|a| a.op(Opcode::FAdd, &[6]));
    refused(&a, at, "OpFAdd ends before its result id");
}

#[test]
fn branches_lead_to_blocks_of_their_function() {
    let branch = |op: Opcode, operands: &[u32]| {
        let mut a = typed();
        a.op(Opcode::ConstantTrue, &[3, 10]);
        a.op(Opcode::Function, &[1, 50, 0, 2]);
        a.op(Opcode::Label, &[51]);
        let at = a.op(op, operands);
        a.op(Opcode::Label, &[52]);
        a.op(Opcode::Return, &[]);
        a.op(Opcode::FunctionEnd, &[]);
        a.function(60, 61, |a| {
            a.op(Opcode::Return, &[]);
        });
        (a, at)
    };
    assert!(branch(Opcode::Branch, &[52]).0.load().is_ok());
    let (a, at) = branch(Opcode::Branch, &[61]);
    refused(&a, at + 1, "OpBranch: expected a label of the same function, found %61 (a label)");
    let (a, at) = branch(Opcode::Branch, &[8]);
    refused(&a, at + 1, "OpBranch: expected a label of the same function, found %8 (a constant)");
    let (a, at) = branch(Opcode::Branch, &[99]);
    refused(&a, at + 1, "OpBranch names %99, but nothing defines it");
    let (a, at) = branch(Opcode::BranchConditional, &[10, 52, 8]);
    refused(&a, at + 3, "OpBranchConditional: expected a label of the same function, found %8 (a constant)");
    let (a, at) = branch(Opcode::Switch, &[8, 52, 0, 7]);
    refused(&a, at + 4, "OpSwitch: expected a label of the same function, found %7 (the type vec3)");
    let (a, at) = branch(Opcode::Branch, &[51]);
    refused(&a, at, "a branch leads to %51, the first block of its function");
}

#[test]
fn merges_and_phis_stand_where_they_must() {
    let (a, at) = body(|a| {
        let at = a.op(Opcode::SelectionMerge, &[51, 0]);
        a.op(Opcode::FAdd, &[6, 60, 9, 9]);
        at
    });
    refused(&a, at, "OpSelectionMerge must immediately precede the terminator of block %51");

    let phi = |operands: &[u32], before: bool| {
        let mut a = typed();
        a.op(Opcode::ConstantTrue, &[3, 10]);
        a.op(Opcode::Function, &[1, 50, 0, 2]);
        a.op(Opcode::Label, &[51]);
        a.op(Opcode::SelectionMerge, &[53, 0]);
        a.op(Opcode::BranchConditional, &[10, 52, 53]);
        a.op(Opcode::Label, &[52]);
        a.op(Opcode::Branch, &[53]);
        a.op(Opcode::Label, &[53]);
        if before {
            a.op(Opcode::IAdd, &[5, 54, 8, 8]);
        }
        let at = a.op(Opcode::Phi, &[&[5, 55], operands].concat());
        a.op(Opcode::Return, &[]);
        a.op(Opcode::FunctionEnd, &[]);
        (a, at)
    };
    assert!(phi(&[8, 51, 8, 52], false).0.load().is_ok());
    let (a, at) = phi(&[8, 51, 8, 52], true);
    refused(&a, at, "OpPhi follows another instruction of block %53");
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
    let (a, at) = body(|a| a.op(Opcode::CompositeExtract, &[6, 60, 12, 3]));
    refused(&a, at + 4, "OpCompositeExtract: index 3 is out of range: vec3 has 3 parts");

    let (a, at) = body(|a| a.op(Opcode::CompositeExtract, &[6, 60, 12, 1, 0]));
    refused(&a, at + 5, "OpCompositeExtract: cannot index into float");

    let (a, at) = body(|a| a.op(Opcode::CompositeExtract, &[5, 60, 12, 1]));
    refused(&a, at + 1, "OpCompositeExtract: expected the type float, found uint");

    let (a, at) = body(|a| a.op(Opcode::CompositeInsert, &[7, 60, 8, 12, 1]));
    refused(&a, at + 3, "OpCompositeInsert: expected the type float, found uint");

    let (a, at) = body(|a| {
        a.op(Opcode::Variable, &[11, 60, 7]);
        a.op(Opcode::Load, &[6, 61, 60])
    });
    refused(&a, at + 1, "OpLoad: expected the type vec3, found float");

    let (a, at) = body(|a| {
        a.op(Opcode::Variable, &[11, 60, 7]);
        a.op(Opcode::Store, &[60, 9])
    });
    refused(&a, at + 2, "OpStore: expected the type vec3, found float");

    let (a, at) = body(|a| a.op(Opcode::Load, &[6, 61, 12]));
    refused(&a, at + 3, "OpLoad: expected a pointer, found %12 (a constant)");

    let mut a = typed();
    a.op(Opcode::TypeStruct, &[20, 6, 7]);
    a.op(Opcode::TypePointer, &[21, 6, 20]);
    a.op(Opcode::TypePointer, &[22, 6, 6]);
    a.op(Opcode::Variable, &[21, 23, 6]);
    a.op(Opcode::Constant, &[4, 24, u32::MAX]);
    let mut at = 0;
    a.function(50, 51, |a| {
        at = a.op(Opcode::AccessChain, &[22, 60, 23, 24]);
        a.op(Opcode::Return, &[]);
    });
    refused(&a, at + 4, "OpAccessChain: index -1 is out of range: struct %20 has 2 parts");
}

#[test]
fn local_variables_stand_in_the_first_block() {
    let (a, at) = body(|a| a.op(Opcode::Variable, &[11, 60, 6]));
    let error = a.refused();
    assert_eq!(word(&error), Some(at + 3));
    assert_eq!(error.message(), "OpVariable inside a function must have the storage class Function");

    let (a, at) = body(|a| {
        a.op(Opcode::Branch, &[60]);
        a.op(Opcode::Label, &[60]);
        a.op(Opcode::Variable, &[11, 61, 7])
    });
    refused(&a, at, "OpVariable follows the function's first block");
}

#[test]
fn calls_match_their_functions_and_form_no_cycle() {
    let call = |operands: &[u32]| {
        let mut a = Assembler::new();
        a.with_string(Opcode::EntryPoint, &[5313, 50], "main", &[]);
        a.types();
        a.op(Opcode::TypeFunction, &[20, 6, 6]);
        a.op(Opcode::Constant, &[6, 21, 0]);
        let mut at = 0;
        a.function(50, 51, |a| {
            at = a.op(Opcode::FunctionCall, operands);
            a.op(Opcode::Return, &[]);
        });
        a.op(Opcode::Function, &[6, 60, 0, 20]);
        a.op(Opcode::FunctionParameter, &[6, 61]);
        a.op(Opcode::Label, &[62]);
        let back = a.op(Opcode::FunctionCall, &[6, 63, 60, 61]);
        a.op(Opcode::ReturnValue, &[63]);
        a.op(Opcode::FunctionEnd, &[]);
        (a, at, back)
    };
    let (a, _, back) = call(&[6, 52, 60, 21]);
    refused(&a, back + 3, "OpFunctionCall closes a cycle of calls at %60 (a function)");
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
fn a_cycle_that_no_entry_point_reaches_is_accepted() {
    let mut a = typed();
    a.function(50, 51, |a| {
        a.op(Opcode::FunctionCall, &[1, 52, 50]);
        a.op(Opcode::Return, &[]);
    });
    assert!(a.load().is_ok());
}
