//! `smoke` says of a module what it says of it after `spirv-opt -O`: its made-up values are keyed
//! by set, binding, array element and byte offset, so that neither the order of declarations nor
//! what an optimizer removes changes them.

use std::path::Path;
use std::sync::Arc;

use anyhit_cases::smoke::{EntryReport, SmokeOptions, SmokeReport, SmokeVerdict};
use anyhit_judges::{Recipe, bytes, optimise, words};
use rayon::prelude::*;

#[path = "../../tests/support/files.rs"]
mod files;

/// Every entry point's name, its verdict and those of its runs.
fn verdicts(words: &[u32]) -> Result<Vec<(String, SmokeVerdict, Vec<(&'static str, SmokeVerdict)>)>, String> {
    let module = Arc::new(anyhit_engine::module::load(&bytes(words)).map_err(|error| error.render())?);
    let told = |entry: EntryReport| {
        let runs = entry.runs.iter().filter(|run| !run.is_note());
        let runs = runs.map(|run| (run.with, run.result)).collect();
        (entry.name, entry.result, runs)
    };
    Ok(SmokeReport::of(&module, SmokeOptions::default()).entry_points.into_iter().map(told).collect())
}

#[test]
fn verdicts_survive_the_optimizer() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository").join("spirv-fixtures");
    let judged: Vec<Result<bool, String>> = files::with_extension(&root, "spv")
        .into_par_iter()
        .map(|path| {
            let name = path.strip_prefix(&root).expect("a fixture").display().to_string();
            let module = words(&std::fs::read(&path).expect("a readable fixture"));
            // What SPIRV-Tools does not know, it cannot optimise.
            let Ok(optimised) = optimise(&module, Recipe::Performance) else { return Ok(false) };
            let (before, after) = (verdicts(&module)?, verdicts(&optimised)?);
            match before == after {
                true => Ok(true),
                false => Err(format!("{name}:\n    before: {before:?}\n    after:  {after:?}")),
            }
        })
        .collect();
    let wrong: Vec<&String> = judged.iter().filter_map(|one| one.as_ref().err()).collect();
    let compared = judged.iter().filter(|one| matches!(one, Ok(true))).count();
    println!("{compared} of {} modules compared, {} differ", judged.len(), wrong.len());
    for problem in &wrong {
        println!("{problem}");
    }
    assert!(wrong.is_empty(), "{} verdicts changed", wrong.len());
    assert!(compared > 220, "only {compared} modules were compared");
}
