//! Which files use each other in a circle.
//!
//! A file of a circle can be neither read nor changed without the others. So circles are few, each
//! has a reason, and a new one is a failure that prints what ties it. What is used by two files of
//! a circle usually belongs into a file below both.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use crate::support::imports::Imports;

/// The roots of the crates and of the benchmarks that have several files.
const ROOTS: &[&str] = &[
    "crates/base/src/lib.rs",
    "crates/cases/src/lib.rs",
    "crates/compile/src/lib.rs",
    "crates/debugger/src/lib.rs",
    "crates/engine/src/lib.rs",
    "crates/explain/src/lib.rs",
    "crates/sanitize/src/lib.rs",
    "crates/scene/src/lib.rs",
    "crates/stress/src/lib.rs",
    "crates/unit-test/src/lib.rs",
    "src/lib.rs",
    "benches/growth/main.rs",
    "benches/peers/main.rs",
    "benches/speed/main.rs",
    "benches/time_vs_error/main.rs",
];

/// The circles that there are, each with its reason.
const ALLOWED: &[(&[&str], &str)] = &[
    (
        &[
            "crates/engine/src/ops/address.rs",
            "crates/engine/src/ops/builtin/check.rs",
            "crates/engine/src/ops/conversion/encoded.rs",
            "crates/engine/src/ops/float_controls.rs",
            "crates/engine/src/ops/heap.rs",
            "crates/engine/src/ops/integer_operand.rs",
            "crates/engine/src/ops/load_store.rs",
            "crates/engine/src/ops/object.rs",
            "crates/engine/src/ops/pointer.rs",
            "crates/engine/src/ops/pointer_layout.rs",
            "crates/engine/src/ops/pointer_stride.rs",
            "crates/engine/src/ops/translate.rs",
            "crates/engine/src/ops/translate/budget.rs",
            "crates/engine/src/ops/translate/values.rs",
            "crates/engine/src/ops/untyped_pointer.rs",
        ],
        "the translator holds the pointers and values that ids stand for, and they are made with it",
    ),
    (
        &["crates/engine/src/pipeline/stack.rs", "crates/engine/src/pipeline/trapped.rs"],
        "the report of a trap names the calls on the stack, whose methods it is written as",
    ),
];

#[test]
fn circles_have_reasons() {
    let base = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut mistakes = String::new();
    let mut met = BTreeSet::new();
    let mut ties = 0;
    for root in ROOTS {
        let imports = Imports::of_crate(&base.join(root), base);
        ties += imports.names.len();
        for circle in imports.circles() {
            let files: Vec<&str> = circle.iter().map(|&file| imports.files[file].as_str()).collect();
            match ALLOWED.iter().position(|(allowed, _)| *allowed == files) {
                Some(known) => _ = met.insert(known),
                None => {
                    let tied = imports.ties(&circle);
                    writeln!(mistakes, "a circle without a reason: {files:?}\n{tied}").unwrap();
                }
            }
        }
    }
    for (number, (files, reason)) in ALLOWED.iter().enumerate() {
        if !met.contains(&number) {
            writeln!(mistakes, "a listed circle that is none: {files:?} ({reason})").unwrap();
        }
    }
    assert!(ties > 1000, "only {ties} files use others: the test reads the wrong lines");
    assert!(mistakes.is_empty(), "\n{mistakes}");
}

/// A crate of these files, read.
fn imports(files: &[(&str, &str)]) -> Imports {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder is made");
        fs::write(path, text).expect("a file is written");
    }
    Imports::of_crate(&folder.path().join("lib.rs"), folder.path())
}

#[test]
fn circles_are_found_through_re_exports() {
    let found = imports(&[
        ("lib.rs", "mod room; pub use room::A;"),
        ("room/mod.rs", "mod a;\nmod b;\nmod c;\npub use self::{a::A, b::{B, make as made}};"),
        ("room/a.rs", "use crate::room::B; // crate::room::c::C\npub struct A(B);"),
        ("room/b.rs", "pub struct B;\npub fn make() -> super::A { super::c::of(b'\"', \"::a\") }"),
        ("room/c.rs", "use crate::room as own;\nfn of<'a>() -> &'a str { own::a::generated!() }"),
    ]);
    let circles = found.circles();
    assert_eq!(circles.len(), 1);
    assert_eq!(
        found.ties(&circles[0]),
        "  room/a.rs -> room/b.rs: B\n  room/b.rs -> room/a.rs: A\n  \
         room/b.rs -> room/c.rs: of\n  room/c.rs -> room/a.rs: generated"
    );
}

#[test]
fn tests_and_own_parts_tie_nothing() {
    let found = imports(&[
        ("lib.rs", "mod a;\nmod b;\nmod whole;"),
        (
            "a.rs",
            "#[cfg(test)]\nuse crate::b::{B, C};\n#[cfg(test)]\nmod tests { use crate::b::B; }\npub struct A;",
        ),
        ("b.rs", "#[cfg(test)]\nmod tests;\n#[derive(Debug)]\npub struct B(crate::a::A);"),
        ("b/tests.rs", "not read {"),
        ("whole.rs", "mod part;\nuse part::Part;\npub struct Whole(Part);"),
        ("whole/part.rs", "pub struct Part(Option<Box<super::Whole>>);"),
    ]);
    assert_eq!(found.files.len(), 5, "{:?}", found.files);
    assert_eq!(found.names.len(), 2, "{:?}", found.names);
    assert!(found.circles().is_empty());
}
