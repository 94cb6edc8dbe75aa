//! A ray that the host traces: its operands and its outcome.

use crate::accel::{Committed, TraceRay};
use crate::pipeline::stats::Stats;

/// The result of one ray.
#[derive(Clone, Debug, PartialEq)]
pub struct RayOutcome {
    /// The closest hit; `None` for a miss.
    pub committed: Option<Committed>,
    /// The payload's words.
    pub payload: Vec<u32>,
    /// What a sanitizer knows of each word of the payload; empty where none has observed the ray.
    pub shadow: Vec<ShadowWord>,
    /// Counts of the work done.
    pub stats: Stats,
}

/// What a sanitizer knows of a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShadowWord {
    /// Whether it is undefined.
    pub is_undefined: bool,
    /// The number of the cause why it is, or of the NaN or infinity that it holds;
    /// [`NO_CAUSE`](crate::machine::NO_CAUSE) where none is known.
    pub cause: u32,
}

/// The operands of a ray that the host traces, without a ray generation shader.
#[derive(Clone, Debug, PartialEq)]
#[must_use]
pub struct RayOperands {
    /// Ray, flags, cull mask.
    pub trace: TraceRay,
    /// SBT offset.
    pub sbt_offset: u32,
    /// SBT stride.
    pub sbt_stride: u32,
    /// Miss index.
    pub miss_index: u32,
    /// The payload's words.
    pub payload: Vec<u32>,
}
