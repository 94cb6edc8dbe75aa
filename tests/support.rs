//! What is supported is known for all of SPIR-V, is true of the fixtures, and is what the
//! documents say. `BLESS=1 cargo test --test support` rewrites the documents' tables.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhit::module::load;
use anyhit::ops::support::{gaps, table};
use anyhit::program::lower;
use pretty_assertions::assert_eq;

#[path = "support/files.rs"]
mod files;

const BEGIN: &str = "<!-- support table: written by tests/support.rs -->\n";
const END: &str = "<!-- end of support table -->";

#[test]
fn everything_in_the_grammar_is_classed() {
    assert_eq!(table::unclassed(), Vec::<String>::new());
}

#[test]
fn what_lowers_has_no_gaps() {
    let mut lowered = 0;
    let mut wrong = Vec::new();
    for path in files::with_extension(&root().join("spirv-fixtures"), "spv") {
        let bytes = fs::read(&path).expect("a readable fixture");
        let module = Arc::new(load(&bytes).expect("a fixture that loads"));
        for entry in &module.entry_points {
            if lower(&module, entry).is_err() {
                continue;
            }
            lowered += 1;
            let gaps = gaps(&module, entry);
            if !gaps.is_empty() {
                wrong.push(format!("{} `{}`: {gaps:?}", path.display(), entry.name));
            }
        }
    }
    assert!(lowered > 70, "only {lowered} entry points lower");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_documents_tables_are_those_of_the_instruction_set() {
    check("README.md", &table::summary());
    check("docs/support.md", &table::listing());
}

/// Compares what stands between the marks of a document, or rewrites it.
fn check(document: &str, expected: &str) {
    let path = root().join(document);
    let text = fs::read_to_string(&path).expect("a readable document").replace("\r\n", "\n");
    let (before, rest) = text.split_once(BEGIN).expect("the mark where the table begins");
    let (table, after) = rest.split_once(END).expect("the mark where the table ends");
    if std::env::var_os("BLESS").is_some_and(|value| value == "1") {
        fs::write(&path, format!("{before}{BEGIN}{expected}{END}{after}")).expect("a writable document");
        return;
    }
    assert_eq!(table, expected, "{document} is out of date: BLESS=1 cargo test --test support");
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_path_buf()
}
