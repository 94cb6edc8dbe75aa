//! Random modules, drawn as SPIR-V itself: functions with pointers, composites in every storage
//! class, structured control flow with phis, all widths, atomic and subgroup instructions.
//!
//! [`generate`] draws a tree, [`emit`] writes its words, and [`evaluate`] says what those words
//! mean; it shares no code with the interpreter, which must leave the same in memory at 1, 8 and 64
//! lanes. A failing module is made small by [`reduce`].
//!
//! `ANYHIT_RANDOM_MODULES` is how many modules are drawn, `ANYHIT_RANDOM_SEED` another seed.
#![allow(clippy::print_stdout, reason = "a judge tells how much it has judged")]

mod arithmetic;
mod emit;
mod evaluate;
mod generate;
mod module;
mod random;
mod reader;
mod reduce;
mod run;
mod types;
mod vulkan;

use std::collections::BTreeMap;
use std::time::Instant;

use rayon::prelude::*;

use crate::support::skipped::{self, test_name};
use generate::{Generated, generate};

/// The kinds of constructs that modules must hold.
const KINDS: &[&str] = &[
    "barrier",
    "bit instruction",
    "bitcast",
    "branch",
    "break",
    "call",
    "call again",
    "call in a loop",
    "call with a pointer to a struct",
    "call with a struct",
    "chosen pointer",
    "composite construct",
    "composite extract",
    "composite insert",
    "computed index",
    "continue",
    "continue construct that does work",
    "conversion",
    "copy logical",
    "copy memory",
    "copy object",
    "division",
    "dynamic extract",
    "dynamic insert",
    "early return",
    "extended arithmetic",
    "falls through",
    "float arithmetic",
    "float minimum",
    "leave switch",
    "load",
    "loop",
    "loop in a loop",
    "matrix",
    "output",
    "own atomic",
    "phi",
    "phis that swap",
    "physical storage",
    "return in a loop",
    "select",
    "shared atomic",
    "shift",
    "store",
    "subgroup instruction",
    "switch",
    "switch on another width",
    "undefined, then filled",
    "unreachable merge block",
    "update",
    "vector shuffle",
];

fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok()?.parse().ok()
}

/// What is wrong with a module: `None` where all is well.
fn judge(generated: &Generated, seed: u64) -> Option<String> {
    let words = emit::words(&generated.module);
    let before = run::memory(generated, seed);
    let expected = match evaluate::run(&words, &before, generated.groups, generated.subgroup) {
        Ok(expected) => expected,
        Err(problem) => return Some(problem),
    };
    let mut check = |way: &str, found: &evaluate::Memory| {
        run::difference(generated, &expected, found)
            .map_or(Ok(()), |difference| Err(format!("wrong ({way}): {difference}")))
    };
    run::interpret(&words, &before, generated, &mut check).err()
}

/// A problem's kind, which a smaller module must share: what is wrong, and which way of running
/// shows it.
fn kind(problem: &str) -> &str {
    problem.split(':').next().unwrap_or_default()
}

#[test]
fn modules_give_what_their_words_say() {
    let count = number("ANYHIT_RANDOM_MODULES").unwrap_or(300);
    let seed = number("ANYHIT_RANDOM_SEED").unwrap_or(1);
    let first = number("ANYHIT_RANDOM_FIRST").unwrap_or(0);
    // All of them, for other tools.
    if std::env::var_os("ANYHIT_RANDOM_DUMP").is_some() {
        (first..first + count).for_each(|index| save(&emit::words(&generate(seed, index).module), index));
    }
    let start = Instant::now();
    let mut wrong: Vec<(u64, String)> = (first..first + count)
        .into_par_iter()
        .filter_map(|index| judge(&generate(seed, index), seed).map(|problem| (index, problem)))
        .collect();
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{count} modules of seed {seed} in {seconds:.1} s: {:.0} an hour",
        count as f64 / seconds * 3600.0
    );
    // What costs too much is left to others; no more than a few may.
    let costly = wrong.iter().filter(|(_, problem)| kind(problem) == "costly").count();
    wrong.retain(|(_, problem)| kind(problem) != "costly");
    assert!(costly as u64 <= count / 50, "{costly} of {count} modules cost too much");
    let mut kinds: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for (index, problem) in &wrong {
        kinds.entry(kind(problem)).or_default().push(*index);
    }
    for (index, problem) in wrong.iter().take(40) {
        println!("{index}: {}", problem.lines().next().unwrap_or_default());
    }
    if let Some((index, problem)) = wrong.first() {
        let whole = generate(seed, *index);
        let small = reduce::reduce(&whole, &mut |smaller| {
            judge(smaller, seed).is_some_and(|found| kind(&found) == kind(problem))
        });
        let found = judge(&small, seed).unwrap_or_default();
        let words = emit::words(&small.module);
        save(&words, *index);
        panic!(
            "{} of {count}: {kinds:?}\nmodule {index} of seed {seed}: {problem}\nmade small: {found}\n{}",
            wrong.len(),
            disassemble(&words)
        );
    }
}

/// Leaves a failing module where `ANYHIT_RANDOM_SAVE` says.
fn save(words: &[u32], index: u64) {
    if let Some(folder) = std::env::var_os("ANYHIT_RANDOM_SAVE") {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        std::fs::write(std::path::Path::new(&folder).join(format!("{index}.spv")), bytes)
            .expect("a writable folder");
    }
}

/// A module as text.
fn disassemble(words: &[u32]) -> String {
    use rspirv::binary::Disassemble;
    rspirv::dr::load_words(words).map_or_else(|error| error.to_string(), |module| module.disassemble())
}

/// The generator reaches what it is there for.
#[test]
fn modules_hold_every_kind_of_construct() {
    let count = 1000;
    let all: Vec<Generated> = (0..count).into_par_iter().map(|index| generate(7, index)).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for generated in &all {
        for (kind, count) in &generated.counts {
            *counts.entry(kind).or_default() += count;
        }
    }
    for kind in KINDS {
        let count = counts.get(kind).copied().unwrap_or_default();
        assert!(count > 20, "{kind}: {count} in {counts:#?}");
    }
    // Invocations must part in most of them, and nothing may be undefined.
    let mut parted = 0;
    let all = &all[..200];
    for generated in all {
        let words = emit::words(&generated.module);
        let outputs = evaluate::run(&words, &run::memory(generated, 7), generated.groups, generated.subgroup);
        let outputs = match outputs {
            Err(problem) if kind(&problem) == "costly" => continue,
            outputs => outputs.unwrap_or_else(|problem| panic!("{problem}\n{}", disassemble(&words))),
        };
        let mut own = outputs.buffers[1].chunks(generate::OUTPUTS * 4);
        let first = own.next().expect("an invocation");
        parted += usize::from(own.any(|one| one != first));
    }
    assert!(parted > all.len() * 2 / 3, "{parted}");
}

/// A Vulkan driver leaves the same, where Vulkan says what is left and the driver can do it.
#[test]
fn modules_give_what_a_vulkan_driver_gives() {
    let Some(line) = skipped::variable(test_name!(), "ANYHIT_VULKAN_MODULES") else { return };
    let count = number("ANYHIT_RANDOM_MODULES").unwrap_or(300);
    let seed = number("ANYHIT_RANDOM_SEED").unwrap_or(1);
    let first = number("ANYHIT_RANDOM_FIRST").unwrap_or(0);
    let size = vulkan::subgroup_size(&line);
    let expected = |index: u64| {
        let generated = generate::generate_for(seed, index, Some(size));
        let words = emit::words(&generated.module);
        let before = run::memory(&generated, seed);
        let (after, open) = evaluate::run_watched(&words, &before, generated.groups, size).ok()?;
        (!open && !generated.recent).then_some((index, generated, words, before, after))
    };
    let (mut judged, mut wrong) = (0, Vec::new());
    for start in (first..first + count).step_by(500) {
        let all: Vec<_> =
            (start..(first + count).min(start + 500)).into_par_iter().filter_map(expected).collect();
        let modules: Vec<_> =
            all.iter().map(|(_, generated, words, before, _)| (generated, words.clone(), before)).collect();
        let left = vulkan::run(&line, &modules).unwrap_or_else(|problem| panic!("{problem}"));
        judged += left.len();
        for ((index, generated, words, _, after), found) in all.iter().zip(&left) {
            if let Some(difference) = run::difference(generated, after, found) {
                wrong.push((*index, difference, words.len()));
            }
        }
    }
    println!("{judged} of {count} modules judged by a Vulkan driver, {} differ", wrong.len());
    for (index, difference, _) in wrong.iter().take(20) {
        println!("{index}: {difference}");
    }
    if let Some((index, difference, _)) = wrong.iter().min_by_key(|(_, _, size)| *size) {
        let whole = generate::generate_for(seed, *index, Some(size));
        let small = reduce::reduce(&whole, &mut |smaller| vulkan_differs(&line, smaller, seed).is_some());
        let found = vulkan_differs(&line, &small, seed).unwrap_or_default();
        let words = emit::words(&small.module);
        save(&words, *index);
        let count = wrong.len();
        panic!(
            "{count} of {judged}; module {index}: {difference}\nmade small: {found}\n{}",
            disassemble(&words)
        );
    }
    // Most meet a subnormal number somewhere, which a driver may take for zero.
    assert!(judged as u64 > count / 8, "{judged}");
}

/// Where a driver leaves something else than the evaluator.
fn vulkan_differs(line: &str, generated: &Generated, seed: u64) -> Option<String> {
    let words = emit::words(&generated.module);
    let before = run::memory(generated, seed);
    let (after, open) = evaluate::run_watched(&words, &before, generated.groups, generated.subgroup).ok()?;
    if open {
        return None;
    }
    // Where a smaller module breaks the driver, it shows something else.
    let left = vulkan::run(line, &[(generated, words, &before)]).ok()?;
    run::difference(generated, &after, &left[0])
}

#[test]
fn a_seed_draws_the_same_module() {
    let words = |seed, index| emit::words(&generate(seed, index).module);
    assert_eq!(words(3, 5), words(3, 5));
    assert_ne!(words(3, 5), words(3, 6));
    assert_ne!(words(3, 5), words(4, 5));
}
