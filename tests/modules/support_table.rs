//! What is supported is known for all of SPIR-V, is true of the fixtures, and is what the
//! documents say. `BLESS=1 cargo test --test main support_table::` rewrites the documents' tables.
//!
//! `spirv_extensions.txt` lists the extensions of SPIR-V's grammar;
//! `ANYHIT_SPIRV_GRAMMAR=spirv.core.grammar.json` compares it with the grammar, and with `BLESS=1`
//! writes it.

use std::collections::{BTreeSet, HashSet};
use std::fs;
use std::sync::Arc;

use anyhit_engine::module::{Opcode, load};
use anyhit_engine::ops::support::{Support, builtin, gaps, opcode, table};
use anyhit_engine::program::lower;
use pretty_assertions::assert_eq;
use rspirv::spirv::BuiltIn;
use serde_json::Value;

use crate::support::files::{self, root};
use crate::support::skipped::{skipped, test_name};

const BEGIN: &str = "<!-- support table: written by tests/modules/support_table.rs -->\n";
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

/// What runs is in a module that tests run, or in a program or a row's vector of the tests' own.
#[test]
fn what_is_called_supported_is_run_by_a_test() {
    let mut run = [HashSet::new(), HashSet::new()];
    for path in files::with_extension(&root().join("spirv-fixtures"), "spv") {
        let module = load(&fs::read(&path).expect("a readable fixture")).expect("a fixture that loads");
        let mut at = 5;
        while let Some(&first) = module.words.get(at) {
            let words = &module.words[at..at + (first >> 16) as usize];
            run[0].insert(first & 0xffff);
            // OpDecorate and OpMemberDecorate with BuiltIn.
            match *words {
                [_, _, 11, builtin] if first & 0xffff == 71 => drop(run[1].insert(builtin)),
                [_, _, _, 11, builtin] if first & 0xffff == 72 => drop(run[1].insert(builtin)),
                _ => {}
            }
            at += words.len();
        }
    }
    let mut text = String::new();
    for path in files::with_extension(&root().join("tests"), "rs") {
        text += &fs::read_to_string(path).expect("a readable test");
    }
    let mut vectors = String::new();
    for path in files::with_extension(&root().join("crates/engine/src/ops"), "rs") {
        let source = fs::read_to_string(path).expect("a readable source");
        vectors += source.split_once("#[cfg(test)]").map_or("", |(_, tests)| tests);
    }
    let words = |text: &str| -> HashSet<String> {
        text.split(|c: char| !c.is_ascii_alphanumeric()).map(str::to_owned).collect()
    };
    let (text, vectors) = (words(&text), words(&vectors));
    let mut missing = Vec::new();
    for op in Opcode::all() {
        let supported = opcode(op).is_some_and(Support::is_supported);
        let name = op.to_string();
        let known = run[0].contains(&op.0.into()) || text.contains(&name);
        if supported && !known && !vectors.contains(name.trim_start_matches("Op")) {
            missing.push(name);
        }
    }
    for number in 0..u32::from(u16::MAX) {
        let Some(known) =
            BuiltIn::from_u32(number).filter(|_| builtin(number).is_some_and(Support::is_supported))
        else {
            continue;
        };
        let name = format!("{known:?}");
        if !run[1].contains(&number) && !text.contains(&name) && !vectors.contains(&name) {
            missing.push(name);
        }
    }
    assert_eq!(missing, Vec::<String>::new());
}

#[test]
fn the_documents_tables_are_those_of_the_instruction_set() {
    check("docs/support.md", &format!("{}\n{}", table::summary(), table::listing()));
    let readme = fs::read_to_string(root().join("README.md")).expect("the README");
    let summary = table::summary();
    let row = summary.lines().find(|line| line.starts_with("| SPIR-V instructions |")).expect("their row");
    let count = row.split('|').nth(2).expect("a column").trim();
    assert!(readme.contains(&format!("[{count} SPIR-V instructions]")), "{count} instructions are supported");
}

const EXTENSIONS: &str = "tests/modules/spirv_extensions.txt";

/// The classes of extensions are written by hand.
#[test]
fn every_extension_has_its_row() {
    let list = fs::read_to_string(root().join(EXTENSIONS)).expect("the list").replace("\r\n", "\n");
    let mut known: Vec<&str> = list.lines().skip(1).collect();
    assert!(known.len() > 190, "{}", known.len());
    let page = fs::read_to_string(root().join("docs/support.md")).expect("the page");
    let (_, section) = page.split_once("## Extensions\n").expect("the section");
    let (section, _) = section.split_once("\n## ").expect("its end");
    let title = list.lines().next().and_then(|line| line.split(": ").next()).expect("a title");
    let revision = title.trim_start_matches("# Extensions that the grammar of ").trim_end_matches(" names");
    assert!(section.contains(revision.trim_end_matches(',')), "{revision}");
    let mut classed: Vec<&str> = section.split('`').filter(|word| word.starts_with("SPV_")).collect();
    classed.sort_unstable();
    known.sort_unstable();
    assert_eq!(classed, known);
}

#[test]
fn the_list_of_extensions_is_that_of_the_grammar() {
    let Some(grammar) = std::env::var_os("ANYHIT_SPIRV_GRAMMAR") else {
        return skipped(test_name!(), "ANYHIT_SPIRV_GRAMMAR names no registry");
    };
    let grammar: Value =
        serde_json::from_str(&fs::read_to_string(grammar).expect("the grammar")).expect("JSON");
    let items = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let mut entries = items(&grammar["instructions"]);
    entries.extend(items(&grammar["operand_kinds"]).iter().flat_map(|kind| items(&kind["enumerants"])));
    let names: BTreeSet<String> = entries
        .iter()
        .flat_map(|entry| items(&entry["extensions"]))
        .map(|name| name.as_str().expect("a name").to_owned())
        .collect();
    let mut list = format!(
        "# Extensions that the grammar of SPIR-V {}.{}, revision {}, names: tests/modules/support_table.rs says \
         how this is written.\n",
        grammar["major_version"], grammar["minor_version"], grammar["revision"]
    );
    names.iter().for_each(|name| list += &format!("{name}\n"));
    let path = root().join(EXTENSIONS);
    if std::env::var_os("BLESS").is_some_and(|value| value == "1") {
        fs::write(&path, &list).expect("a writable list");
    }
    assert!(fs::read_to_string(&path).expect("the list") == list, "BLESS=1 writes {EXTENSIONS} again");
}

/// Compares what stands between the marks of a document, or rewrites it.
fn check(document: &str, expected: &str) {
    let path = root().join(document);
    let text = fs::read_to_string(&path).expect("a readable document").replace("\r\n", "\n");
    let (before, rest) = text.split_once(BEGIN).expect("the mark where the table begins");
    let (table, after) = rest.split_once(END).expect("the mark where the table ends");
    // Not when it is right: tests that run meanwhile read the documents.
    if table != expected && std::env::var_os("BLESS").is_some_and(|value| value == "1") {
        fs::write(&path, format!("{before}{BEGIN}{expected}{END}{after}")).expect("a writable document");
        return;
    }
    assert_eq!(table, expected, "{document} is out of date: BLESS=1 cargo test --test main support_table::");
}
