//! What depends on rounding: outputs and decisions that differ between perturbed runs.

use crate::stability::envelope::Envelope;
use crate::stability::place::SourceLocation;
use anyhit_base::error::Error;
use anyhit_base::sorted::SortedMap;

/// How runs are perturbed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// The number of runs.
    pub runs: u32,
    /// The first of them that is done, from 1: a share of the runs draws what these draw.
    pub first_run: u32,
    /// The seed of the random numbers; they do not depend on the order of threads.
    pub seed: u64,
    /// How far results are moved.
    pub envelope: Envelope,
    /// How far floats of the outputs may differ: as a share of the value, or absolutely below 1.
    pub tolerance: f64,
}

impl Default for Perturbation {
    fn default() -> Self {
        Self { runs: 16, first_run: 1, seed: 1, envelope: Envelope::Vulkan, tolerance: 0.01 }
    }
}

/// The kind of a decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DecisionKind {
    /// The target of a branch or switch.
    Branch,
    /// The primitive that a traced ray hits.
    Hit,
}

/// What differs between perturbed runs.
#[derive(Clone, Debug, Default)]
pub struct Instability {
    /// How runs were perturbed.
    pub perturbation: Perturbation,
    /// The number of outputs.
    pub output_count: usize,
    /// Outputs that differ by more than the tolerance.
    pub outputs: Vec<UnstableOutput>,
    /// The first decisions at which invocations diverge from the run without perturbation, and the
    /// number of invocations.
    pub branches: SortedMap<(SourceLocation, DecisionKind), u64>,
    /// Runs that trapped, numbered from 1.
    pub traps: Vec<(u32, Error)>,
}

impl Instability {
    /// Whether every output was the same in every run.
    pub fn is_stable(&self) -> bool {
        self.outputs.is_empty() && self.traps.is_empty()
    }
}

/// An output that differs between runs.
#[derive(Clone, Debug, PartialEq)]
pub struct UnstableOutput {
    /// The value that differs most: `` `sums` values[3] ``, `` `image` texel (4, 2).r ``,
    /// `payload.color[0]`.
    pub name: String,
    /// The number of values of the output that differ in some run.
    pub values: usize,
    /// The value without perturbation.
    pub reference: String,
    /// The value that differs most from the reference.
    pub other: String,
    /// The number of its run, from 1.
    pub run: u32,
    /// By how much, as a share of the value or absolutely below 1; infinite for what is no float.
    pub difference: f64,
}
