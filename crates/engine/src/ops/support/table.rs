//! The classes as tables in Markdown, for `docs/support.md`.

use crate::module::Opcode;
use std::fmt::Write;

use rspirv::grammar::GLSL_STD_450_INSTRUCTION_TABLE;
use rspirv::spirv::{BuiltIn, StorageClass};

use crate::ops::support::{Support, builtin, glsl, opcode, storage_class};
use anyhit_base::sorted::SortedMap;

/// A kind of thing that has a class, and all of its things by name.
struct Kind {
    title: &'static str,
    things: Vec<(String, Option<Support>)>,
}

/// One line a kind: how many run, how many do not yet, how many are out of scope.
pub fn summary() -> String {
    let mut out = String::from("| | run | not yet | out of scope |\n|---|---|---|---|\n");
    for kind in kinds() {
        let mut counts = [0; 3];
        for support in kind.things.iter().filter_map(|(_, support)| *support) {
            counts[rank(support)] += 1;
        }
        let [run, not_yet, out_of_scope] = counts;
        // Writing to a string does not fail.
        let _ = writeln!(out, "| {} | {run} | {not_yet} | {out_of_scope} |", kind.title);
    }
    out
}

/// Every name, by kind, class and group.
pub fn listing() -> String {
    let mut out = String::new();
    for kind in kinds() {
        let _ = write!(out, "## {}\n\n| class | group | names |\n|---|---|---|\n", kind.title);
        let mut groups: SortedMap<(usize, &str), Vec<&str>> = SortedMap::new();
        for (name, support) in &kind.things {
            if let Some(support) = *support {
                groups.entry((rank(support), support.group())).or_default().push(name);
            }
        }
        for ((rank, group), names) in groups {
            let class = ["runs", "not yet", "out of scope"][rank];
            let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
            let _ = writeln!(out, "| {class} | {group} | {} |", names.join(" "));
        }
        out.push('\n');
    }
    out.truncate(out.trim_end().len());
    out.push('\n');
    out
}

/// Names of what the grammar has and no list classes.
pub fn unclassed() -> Vec<String> {
    let things = kinds().into_iter().flat_map(|kind| kind.things);
    things.filter(|(_, support)| support.is_none()).map(|(name, _)| name).collect()
}

fn kinds() -> Vec<Kind> {
    let core = Opcode::all().map(|op| (op.to_string(), opcode(op)));
    let extended = GLSL_STD_450_INSTRUCTION_TABLE.iter();
    let extended = extended.map(|entry| (entry.opname.to_owned(), glsl(entry.opcode.into())));
    let numbers = || 0..u32::from(u16::MAX);
    let builtins =
        numbers().filter_map(|number| Some((format!("{:?}", BuiltIn::from_u32(number)?), builtin(number))));
    let storage = numbers()
        .filter_map(|number| Some((format!("{:?}", StorageClass::from_u32(number)?), storage_class(number))));
    vec![
        Kind { title: "SPIR-V instructions", things: core.collect() },
        Kind { title: "GLSL.std.450 instructions", things: extended.collect() },
        Kind { title: "built-ins", things: builtins.collect() },
        Kind { title: "storage classes", things: storage.collect() },
    ]
}

fn rank(support: Support) -> usize {
    match support {
        Support::Supported(_) => 0,
        Support::Unsupported(_) => 1,
        Support::OutOfScope(_) => 2,
    }
}
