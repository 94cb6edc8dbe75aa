//! Random programs, judged by evaluators that share nothing with the interpreter.
//!
//! A [`Program`] is a tree of statements that the generator drew: integers of 32 and 64 bits,
//! floats, vectors, arrays, branches, loops, switches, phis and calls. [`emit`] writes it as
//! SPIR-V, which runs here at 1, 64 and 128 lanes; [`evaluate`] walks the tree itself, one
//! invocation at a time. Where lavapipe is installed, it runs the same modules, too:
//! CONTRIBUTING.md says how.
#![allow(clippy::print_stdout, reason = "what was judged is told")]

mod emit;
mod evaluate;
mod lavapipe;
mod program;

use std::sync::Arc;

use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{BatchWidth, Compute, RunOptions};
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};

use crate::support::assembly;
use crate::support::skipped::{self, test_name};
use program::{INPUTS, OUTPUTS, Program};

/// Workgroups of 32 invocations.
const GROUPS: u32 = 2;
/// All invocations.
const INVOCATIONS: usize = 64;

/// What the invocations read: edge values, small numbers and any numbers.
fn inputs() -> Vec<u32> {
    const EDGES: [u32; 8] = [0, 1, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF, 31, 0x0001_0000, 0x00FF_FF00];
    let mut state = 0x1234_5678u32;
    (0..INVOCATIONS * INPUTS)
        .map(|at| {
            // A linear congruential generator (Numerical Recipes).
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            match at % 3 {
                0 => EDGES[(state >> 24) as usize % EDGES.len()],
                1 => state >> 28,
                _ => state,
            }
        })
        .collect()
}

/// What the interpreter leaves, the same at 1, 64 and 128 lanes.
fn interpret(text: &str, inputs: &[u32]) -> Result<Vec<u32>, String> {
    let told = |error: anyhit::Error| error.render();
    let module = Arc::new(anyhit_engine::module::load(&assembly::assemble(text)).map_err(told)?);
    let program = anyhit_engine::program::lower(&module, &module.entry_points[0]).map_err(told)?;
    let compute = Compute::new(program).map_err(told)?;
    let run = |lanes: BatchWidth| {
        let out = Buffer::zeroed(INVOCATIONS * OUTPUTS * 4);
        let given: Vec<u8> = inputs.iter().flat_map(|word| word.to_le_bytes()).collect();
        let resources = Resources::default().bind(0, 0, Descriptor::Buffer(Buffer::new(&given))).bind(
            0,
            1,
            Descriptor::Buffer(out.clone()),
        );
        let groups = [GROUPS, 1, 1];
        compute.run(&resources, groups, RunOptions::of(lanes)).map_err(told)?;
        Ok::<_, String>(bytemuck::pod_collect_to_vec::<u8, u32>(&out.bytes()))
    };
    let one = run(BatchWidth::One)?;
    for lanes in [BatchWidth::Of64, BatchWidth::Of128] {
        if let Some(difference) = difference(&one, &run(lanes)?) {
            return Err(format!("1 and {lanes} lanes: {difference}"));
        }
    }
    Ok(one)
}

/// Where two results part.
fn difference(one: &[u32], other: &[u32]) -> Option<String> {
    let at = one.iter().zip(other).position(|(one, other)| one != other)?;
    let (invocation, slot) = (at / OUTPUTS, at % OUTPUTS);
    Some(format!("invocation {invocation}, output {slot}: {:#x} / {:#x}", one[at], other[at]))
}

/// Programs as lists of numbers: proptest makes a failing one shorter, and its numbers smaller.
fn draws() -> impl proptest::strategy::Strategy<Value = Vec<u32>> {
    proptest::collection::vec(proptest::num::u32::ANY, 1..400)
}

/// Runs `check` on many programs, the same ones every time unless `PROPTEST_CASES` asks for more,
/// and tells of the smallest failing one.
fn for_many(cases: u32, check: impl Fn(&Program) -> Result<(), String>) {
    let cases = if std::env::var_os("PROPTEST_CASES").is_some() { Config::default().cases } else { cases };
    let config = Config { cases, failure_persistence: None, max_shrink_iters: 20_000, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let result = runner.run(&draws(), |numbers| check(&Program::draw(&numbers)).map_err(TestCaseError::fail));
    match result {
        Ok(()) => {}
        Err(TestError::Fail(reason, numbers)) => {
            let program = Program::draw(&numbers);
            panic!("{reason}\n{numbers:?}\n{program:#?}\n{}", emit::text(&program));
        }
        Err(TestError::Abort(reason)) => panic!("{reason}"),
    }
}

#[test]
fn programs_give_what_their_trees_say() {
    let inputs = inputs();
    for_many(2000, |program| {
        let expected = evaluate::run(program, &inputs, INVOCATIONS);
        let found = interpret(&emit::text(program), &inputs)?;
        difference(&found, &expected)
            .map_or(Ok(()), |difference| Err(format!("interpreter / tree: {difference}")))
    });
}

/// The generator reaches what it is there for.
#[test]
fn programs_hold_every_kind_of_statement() {
    let counts = std::cell::RefCell::new(std::collections::BTreeMap::<&str, usize>::new());
    let distinct = std::cell::RefCell::new(0);
    let inputs = inputs();
    for_many(1000, |program| {
        program.count(&mut |kind| *counts.borrow_mut().entry(kind).or_default() += 1);
        let outputs = evaluate::run(program, &inputs, INVOCATIONS);
        let first = &outputs[..OUTPUTS];
        *distinct.borrow_mut() += usize::from(outputs.chunks(OUTPUTS).any(|one| one != first));
        Ok(())
    });
    let (counts, distinct) = (counts.into_inner(), distinct.into_inner());
    for kind in program::KINDS {
        let count = counts.get(kind).copied().unwrap_or_default();
        assert!(count > 20, "{kind}: {count} in {counts:#?}");
    }
    // Invocations must part in most of them.
    assert!(distinct > 400, "{distinct}");
}

#[test]
fn programs_give_what_lavapipe_gives() {
    // The program, where need be behind what brings it into the right surroundings.
    let Some(lavapipe) = skipped::variable(test_name!(), "ANYHIT_VULKAN_COMPUTE") else { return };
    let inputs = inputs();
    let programs = std::cell::RefCell::new(Vec::new());
    for_many(500, |program| {
        programs.borrow_mut().push(program.clone());
        Ok(())
    });
    let programs = programs.into_inner();
    let modules: Vec<Vec<u8>> =
        programs.iter().map(|program| assembly::assemble(&emit::text(program))).collect();
    let outputs = lavapipe::run(&lavapipe, &modules, &inputs, INVOCATIONS * OUTPUTS, GROUPS);
    let mut wrong = Vec::new();
    let (mut judged, mut open) = (0, 0);
    for (program, found) in programs.iter().zip(&outputs) {
        let mut expected =
            interpret(&emit::text(program), &inputs).unwrap_or_else(|problem| panic!("{problem}"));
        let (_, left_open) = evaluate::run_watched(program, &inputs, INVOCATIONS);
        for ((expected, found), left_open) in
            expected.chunks_exact_mut(OUTPUTS).zip(found.chunks_exact(OUTPUTS)).zip(left_open)
        {
            if left_open {
                expected.copy_from_slice(found);
            }
            *if left_open { &mut open } else { &mut judged } += 1;
        }
        if let Some(difference) = difference(&expected, found) {
            wrong.push(format!("{difference}\n{program:#?}\n{}", emit::text(program)));
        }
    }
    println!("{} programs, {judged} invocations judged by lavapipe, {open} left out", programs.len());
    let shortest = wrong.iter().min_by_key(|text| text.len());
    assert!(wrong.is_empty(), "{} of {}; the shortest: {}", wrong.len(), programs.len(), shortest.unwrap());
    // One in a hundred divides by such a number; were they many, there would be nothing left to
    // judge.
    assert!(judged > 20 * open, "{judged} and {open}");
}
