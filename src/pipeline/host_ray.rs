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
    /// Counts of the work done.
    pub stats: Stats,
}

/// The operands of a ray that the host traces, without a ray generation shader.
#[derive(Clone, Debug, PartialEq)]
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
