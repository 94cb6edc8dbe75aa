//! Random modules with each pass of SPIRV-Tools alone, and with all passes of `-O`: what a pass
//! makes of a module must leave the same in memory, by the evaluator of
//! `tests/execution/random_modules/` and by the interpreter.
//!
//! `ANYHIT_RANDOM_MODULES` is how many modules are drawn, `ANYHIT_RANDOM_SEED` another seed,
//! `ANYHIT_RANDOM_FIRST` the number of the first module, `ANYHIT_RANDOM_PASS` the one pass to run.

#![allow(dead_code, reason = "what the generator counts is for its own tests")]

/// The generator and the evaluator of the tests of the crate itself.
#[path = "../../tests/execution/random_modules"]
mod random_modules {
    pub mod arithmetic;
    pub mod emit;
    pub mod evaluate;
    pub mod generate;
    pub mod module;
    pub mod random;
    pub mod reader;
    pub mod run;
    pub mod types;
}

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use anyhit_judges::passes::RECIPES;
use anyhit_judges::process::ToolProcess;
use rayon::prelude::*;

use random_modules::{emit, evaluate, generate, run};

/// What became of a module under a pass.
#[derive(Clone, Debug)]
enum Outcome {
    /// The pass leaves the module as it is.
    Unchanged,
    /// The pass changes the module, and not what it means.
    Same,
    /// The pass does not take the module.
    Refused(String),
    /// An assertion of SPIRV-Tools did not hold, or it used a wrong pointer.
    Aborted,
    /// The pass gave it another meaning, by the evaluator: not ours to judge.
    Changed(String),
    /// What the pass made of it is refused, by the validator, too.
    Invalid(String),
    /// The evaluator finds the same meaning, the interpreter another one.
    Wrong(String),
}

/// What all modules came to under one pass.
#[derive(Default)]
struct Tally {
    counts: BTreeMap<&'static str, u64>,
    /// The first module of a kind, and what was told of it.
    first: BTreeMap<&'static str, (u64, String)>,
    wrong: Vec<String>,
}

impl Tally {
    fn note(&mut self, index: u64, outcome: Outcome) {
        let (kind, told) = match outcome {
            Outcome::Unchanged => ("unchanged", None),
            Outcome::Same => ("same", None),
            Outcome::Refused(problem) => ("refused", Some(problem)),
            Outcome::Aborted => ("aborted", Some(String::new())),
            Outcome::Changed(problem) => ("changed by the pass", Some(problem)),
            Outcome::Invalid(problem) => ("made invalid by the pass", Some(problem)),
            Outcome::Wrong(problem) => {
                self.wrong.push(format!("module {index}: {problem}"));
                ("WRONG", None)
            }
        };
        *self.counts.entry(kind).or_default() += 1;
        if let Some(problem) = told {
            self.first_is(kind, index, problem);
        }
    }

    fn first_is(&mut self, kind: &'static str, index: u64, problem: String) {
        if self.first.get(kind).is_none_or(|(first, _)| index < *first) {
            self.first.insert(kind, (index, problem));
        }
    }

    fn merge(&mut self, other: Self) {
        for (kind, count) in other.counts {
            *self.counts.entry(kind).or_default() += count;
        }
        for (kind, (index, problem)) in other.first {
            self.first_is(kind, index, problem);
        }
        self.wrong.extend(other.wrong);
    }
}

#[test]
fn each_pass_keeps_what_modules_mean() {
    let number = |name: &str| std::env::var(name).ok().and_then(|value| value.parse::<u64>().ok());
    let count = number("ANYHIT_RANDOM_MODULES").unwrap_or(150);
    let first = number("ANYHIT_RANDOM_FIRST").unwrap_or(0);
    let seed = number("ANYHIT_RANDOM_SEED").unwrap_or(1);
    let wanted = std::env::var("ANYHIT_RANDOM_PASS").ok();
    let recipes: Vec<usize> = (0..RECIPES.len())
        .filter(|&recipe| wanted.as_ref().is_none_or(|wanted| wanted == RECIPES[recipe].0))
        .collect();
    assert!(!recipes.is_empty(), "no pass has the name {wanted:?}");
    let start = Instant::now();
    let program = Path::new(env!("CARGO_BIN_EXE_spirv_tools"));
    let none = || recipes.iter().map(|_| Tally::default()).collect::<Vec<_>>();
    let tallies = (first..first + count)
        .into_par_iter()
        .fold(
            || (ToolProcess::new(program), none()),
            |(mut tools, mut tallies), index| {
                let outcomes = judge(&mut tools, seed, index, &recipes);
                tallies.iter_mut().zip(outcomes).for_each(|(tally, outcome)| tally.note(index, outcome));
                (tools, tallies)
            },
        )
        .map(|(_, tallies)| tallies)
        .reduce(none, |mut all, more| {
            all.iter_mut().zip(more).for_each(|(all, more)| all.merge(more));
            all
        });
    let seconds = start.elapsed().as_secs_f64();
    let mut judged = 0;
    let mut wrong = Vec::new();
    for (&recipe, tally) in recipes.iter().zip(tallies) {
        let name = RECIPES[recipe].0;
        println!("{}: {:?} {:?}", name, tally.counts, tally.first);
        judged += tally.counts.get("same").copied().unwrap_or_default();
        wrong.extend(tally.wrong.iter().map(|problem| format!("{}, seed {seed}, {problem}", name)));
    }
    println!(
        "{count} modules, {judged} changed ones judged in {seconds:.1} s: {:.0} an hour",
        judged as f64 / seconds * 3600.0
    );
    assert!(wrong.is_empty(), "{}:\n{}", wrong.len(), wrong.join("\n"));
    assert!(judged > 0 || wanted.is_some(), "nothing was judged");
}

/// A module under each of the passes. Passes that make the same of it are judged once.
fn judge(tools: &mut ToolProcess, seed: u64, index: u64, recipes: &[usize]) -> Vec<Outcome> {
    let generated = generate::generate(seed, index);
    let words = emit::words(&generated.module);
    let before = run::memory(&generated, seed);
    let evaluate = |words: &[u32]| evaluate::run(words, &before, generated.groups, generated.subgroup);
    // What costs too much is left to others.
    let Ok(expected) = evaluate(&words) else { return Vec::new() };
    let mut known: BTreeMap<Vec<u32>, Outcome> = BTreeMap::from([(words.clone(), Outcome::Unchanged)]);
    let mut judge = |tools: &mut ToolProcess, optimised: Vec<u32>| {
        if let Some(outcome) = known.get(&optimised) {
            return outcome.clone();
        }
        let changed = match evaluate(&optimised) {
            Ok(found) => run::difference(&generated, &expected, &found),
            Err(problem) => Some(problem),
        };
        let mut check = |way: &str, found: &evaluate::Memory| {
            run::difference(&generated, &expected, found)
                .map_or(Ok(()), |difference| Err(format!("wrong ({way}): {difference}")))
        };
        let outcome = match changed {
            Some(difference) => Outcome::Changed(difference),
            None => match run::interpret(&optimised, &before, &generated, &mut check) {
                Ok(()) => Outcome::Same,
                Err(problem) if problem.starts_with("refused") => match tools.validate(&optimised) {
                    Some(Err(complaint)) => Outcome::Invalid(complaint),
                    _ => Outcome::Wrong(problem),
                },
                Err(problem) => Outcome::Wrong(problem),
            },
        };
        known.insert(optimised, outcome.clone());
        outcome
    };
    let mut outcomes = Vec::new();
    for &recipe in recipes {
        outcomes.push(match tools.optimise(recipe, &words) {
            None => Outcome::Aborted,
            Some(Err(problem)) => Outcome::Refused(problem),
            Some(Ok(optimised)) => judge(tools, optimised),
        });
    }
    outcomes
}
