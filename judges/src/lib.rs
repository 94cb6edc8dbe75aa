//! Independent judges of the interpreter: what SPIRV-Tools makes of a module must mean the same.
//!
//! `tests/folding.rs` lets it fold instructions on constants, `tests/optimised.rs` lets it optimise
//! every fixture, `tests/random_modules.rs` runs each of its passes on random modules,
//! `tests/verdict.rs` and `tests/validation.rs` let it validate mutants of the fixtures,
//! `tests/smoke.rs` compares what `smoke` says of a module before and after `-O`. `.ci/judges` runs
//! them.

pub mod list;
#[path = "../../tests/support/mutate.rs"]
pub mod mutate;
pub mod passes;
pub mod process;
#[path = "../../tests/support/recorded.rs"]
pub mod recorded;
pub mod validation;
pub mod verdict;

use spirv_tools::TargetEnv;
use spirv_tools::opt::compiled::CompiledOptimizer;
use spirv_tools::opt::{Optimizer, Passes};

/// What to do to a module.
#[derive(Clone, Copy, Debug)]
pub enum Recipe {
    /// `--simplify-instructions`, which folds an instruction on constants. Not `--ccp`: its
    /// assertions do not hold where an extended instruction on constants is one that it cannot
    /// fold.
    Fold,
    /// `-O`: inlining, phis for variables, unrolling, and all else of the performance recipe.
    Performance,
    /// One pass alone.
    Pass(Passes),
}

/// Runs the optimizer on the words of a module; its complaint where it does not take the module.
pub fn optimise(words: &[u32], recipe: Recipe) -> Result<Vec<u32>, String> {
    let mut optimizer = CompiledOptimizer::with_env(TargetEnv::Universal_1_6);
    match recipe {
        Recipe::Fold => {
            optimizer
                .register_pass(Passes::FoldSpecConstantOpAndComposite)
                .register_pass(Passes::Simplification);
        }
        Recipe::Performance => {
            optimizer.register_performance_passes();
        }
        Recipe::Pass(pass) => {
            optimizer.register_pass(pass);
        }
    }
    let mut complaints = Vec::new();
    let mut listen = |message: spirv_tools::error::Message| complaints.push(message.message.clone());
    match optimizer.optimize(words, &mut listen, None) {
        Ok(binary) => Ok(AsRef::<[u32]>::as_ref(&binary).to_vec()),
        Err(error) => Err(complaints.first().cloned().unwrap_or_else(|| format!("{error:?}"))),
    }
}

/// The words of a module's bytes.
pub fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().expect("four bytes"))).collect()
}

/// The bytes of a module's words.
pub fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}
