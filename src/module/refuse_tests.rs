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
