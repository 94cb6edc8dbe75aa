//! Random modules with each pass of SPIRV-Tools alone: what a pass makes of a module must leave the same
//! in memory, by the evaluator of `tests/random_modules/` and by the interpreter.
//!
//! `ANYHIT_RANDOM_MODULES` is how many modules are drawn, `ANYHIT_RANDOM_SEED` another seed,
//! `ANYHIT_RANDOM_PASS` the one pass to run.

#![allow(dead_code, reason = "what the generator counts is for its own tests")]

#[path = "../../tests/random_modules/arithmetic.rs"]
mod arithmetic;
#[path = "../../tests/random_modules/emit.rs"]
mod emit;
#[path = "../../tests/random_modules/evaluate.rs"]
mod evaluate;
#[path = "../../tests/random_modules/generate.rs"]
mod generate;
#[path = "../../tests/random_modules/module.rs"]
mod module;
#[path = "../../tests/random_modules/random.rs"]
mod random;
#[path = "../../tests/random_modules/reader.rs"]
mod reader;
#[path = "../../tests/random_modules/run.rs"]
mod run;
#[path = "../../tests/random_modules/types.rs"]
mod types;

use std::collections::BTreeMap;
use std::time::Instant;

use anyhit_judges::optimise_by;
use rayon::prelude::*;
use spirv_tools::opt::Passes;

/// The passes that must keep what a compute shader means. Not among them are those that relax precision,
/// turn what they do not know into something else, are for other stages, or only print; nor five whose
/// own assertions, or wrong pointers, end the process where they meet some of these modules:
/// `ConditionalConstantPropagation`, `EliminateDeadMembers`, `InsertExtractElim`, `LoopPeeling` and
/// `Simplification`.
const PASSES: &[(&str, Passes)] = &[
    ("AggressiveDCE", Passes::AggressiveDCE),
    ("BlockMerge", Passes::BlockMerge),
    ("CFGCleanup", Passes::CFGCleanup),
    ("CodeSinking", Passes::CodeSinking),
    ("CombineAccessChains", Passes::CombineAccessChains),
    ("CompactIds", Passes::CompactIds),
    ("CopyPropagateArrays", Passes::CopyPropagateArrays),
    ("DeadBranchElim", Passes::DeadBranchElim),
    ("DeadInsertElim", Passes::DeadInsertElim),
    ("DeadVariableElimination", Passes::DeadVariableElimination),
    ("EliminateDeadConstant", Passes::EliminateDeadConstant),
    ("EliminateDeadFunctions", Passes::EliminateDeadFunctions),
    ("FlattenDecoration", Passes::FlattenDecoration),
    ("FoldSpecConstantOpAndComposite", Passes::FoldSpecConstantOpAndComposite),
    ("IfConversion", Passes::IfConversion),
    ("InlineExhaustive", Passes::InlineExhaustive),
    ("LocalAccessChainConvert", Passes::LocalAccessChainConvert),
    ("LocalMultiStoreElim", Passes::LocalMultiStoreElim),
    ("LocalRedundancyElimination", Passes::LocalRedundancyElimination),
    ("LocalSingleBlockLoadStoreElim", Passes::LocalSingleBlockLoadStoreElim),
    ("LocalSingleStoreElim", Passes::LocalSingleStoreElim),
    ("LoopInvariantCodeMotion", Passes::LoopInvariantCodeMotion),
    ("LoopUnswitch", Passes::LoopUnswitch),
    ("MergeReturn", Passes::MergeReturn),
    ("PrivateToLocal", Passes::PrivateToLocal),
    ("ReduceLoadSize", Passes::ReduceLoadSize),
    ("RedundancyElimination", Passes::RedundancyElimination),
    ("RemoveDuplicates", Passes::RemoveDuplicates),
    ("RemoveUnusedInterfaceVariables", Passes::RemoveUnusedInterfaceVariables),
    ("SSARewrite", Passes::SSARewrite),
    ("StrengthReduction", Passes::StrengthReduction),
    ("UnifyConstant", Passes::UnifyConstant),
    ("VectorDCE", Passes::VectorDCE),
];

/// What became of a module under a pass.
enum Outcome {
    Same,
    /// The pass does not take the module.
    Refused(String),
    /// The pass gave it another meaning, by the evaluator: not ours to judge.
    Changed(String),
    /// The evaluator finds the same meaning, the interpreter another one.
    Wrong(String),
}

#[test]
fn each_pass_keeps_what_modules_mean() {
    let number = |name: &str| std::env::var(name).ok().and_then(|value| value.parse::<u64>().ok());
    let count = number("ANYHIT_RANDOM_MODULES").unwrap_or(150);
    let seed = number("ANYHIT_RANDOM_SEED").unwrap_or(1);
    let wanted = std::env::var("ANYHIT_RANDOM_PASS").ok();
    let mut wrong = Vec::new();
    let start = Instant::now();
    let mut judged = 0;
    for (name, pass) in PASSES {
        if wanted.as_ref().is_some_and(|wanted| wanted != name) {
            continue;
        }
        let outcomes: Vec<(u64, Outcome)> = (0..count)
            .into_par_iter()
            .filter_map(|index| Some((index, judge(seed, index, *pass)?)))
            .collect();
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        let mut first: BTreeMap<&str, String> = BTreeMap::new();
        for (index, outcome) in outcomes {
            let (kind, told) = match outcome {
                Outcome::Same => ("same", None),
                Outcome::Refused(problem) => ("refused", Some(problem)),
                Outcome::Changed(problem) => ("changed by the pass", Some(problem)),
                Outcome::Wrong(problem) => {
                    wrong.push(format!("{name}, module {index} of seed {seed}: {problem}"));
                    ("WRONG", None)
                }
            };
            *counts.entry(kind).or_default() += 1;
            if let Some(problem) = told {
                first.entry(kind).or_insert(format!("module {index}: {problem}"));
            }
        }
        judged += counts.get("same").copied().unwrap_or_default();
        println!("{name}: {counts:?} {first:?}");
    }
    let seconds = start.elapsed().as_secs_f64();
    println!("{judged} modules judged in {seconds:.1} s: {:.0} an hour", judged as f64 / seconds * 3600.0);
    assert!(wrong.is_empty(), "{}:\n{}", wrong.len(), wrong.join("\n"));
    assert!(judged > 0 || wanted.is_some(), "nothing was judged");
}

/// A module under a pass; `None` where the pass changes nothing, or the module costs too much.
fn judge(seed: u64, index: u64, pass: Passes) -> Option<Outcome> {
    let generated = generate::generate(seed, index);
    let words = emit::words(&generated.module);
    let optimised = match optimise_by(&words, pass) {
        Ok(optimised) => optimised,
        Err(problem) => return Some(Outcome::Refused(problem)),
    };
    if optimised == words {
        return None;
    }
    let before = run::memory(&generated, seed);
    let evaluate = |words: &[u32]| evaluate::run(words, &before, generated.groups, generated.subgroup);
    let expected = evaluate(&words).ok()?;
    let changed = match evaluate(&optimised) {
        Ok(found) => run::difference(&generated, &expected, &found),
        Err(problem) => Some(problem),
    };
    if let Some(difference) = changed {
        return Some(Outcome::Changed(difference));
    }
    let mut check = |way: &str, found: &evaluate::Memory| match run::difference(&generated, &expected, found)
    {
        Some(difference) => Err(format!("wrong ({way}): {difference}")),
        None => Ok(()),
    };
    Some(match run::interpret(&optimised, &before, &generated, &mut check) {
        Ok(()) => Outcome::Same,
        Err(problem) => Outcome::Wrong(problem),
    })
}
