//! A ray that the host traces: its operands and its outcome.

use bytemuck::NoUninit;

use crate::accel::{Committed, RayFlags, TraceRay};
use crate::geometry::Ray;
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

/// A ray without flags, seen by all masks, with SBT offset 0, SBT stride 1 and miss index 0; its
/// payload begins as zeros.
impl From<Ray> for RayOperands {
    fn from(ray: Ray) -> Self {
        Self {
            trace: TraceRay { ray, flags: RayFlags(0), cull_mask: 0xFF, time: 0.0 },
            sbt_offset: 0,
            sbt_stride: 1,
            miss_index: 0,
            payload: Vec::new(),
        }
    }
}

impl RayOperands {
    /// Sets the ray's flags.
    #[must_use]
    pub fn flags(mut self, flags: RayFlags) -> Self {
        self.trace.flags = flags;
        self
    }

    /// Sets the cull mask.
    #[must_use]
    pub fn cull_mask(mut self, cull_mask: u32) -> Self {
        self.trace.cull_mask = cull_mask;
        self
    }

    /// Sets the time, from 0 to 1: where an instance that moves is met.
    #[must_use]
    pub fn time(mut self, time: f32) -> Self {
        self.trace.time = time;
        self
    }

    /// Sets SBT offset and stride.
    #[must_use]
    pub fn sbt(self, sbt_offset: u32, sbt_stride: u32) -> Self {
        Self { sbt_offset, sbt_stride, ..self }
    }

    /// Sets the miss index.
    #[must_use]
    pub fn miss(self, miss_index: u32) -> Self {
        Self { miss_index, ..self }
    }

    /// Sets the payload from a plain Rust type, whose size is a multiple of four bytes: see
    /// `docs/testing.md`, "Reading values", for how its scalars lie.
    #[must_use]
    pub fn payload<T: NoUninit>(self, payload: &T) -> Self {
        let word = |chunk: &[u8]| {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            u32::from_le_bytes(word)
        };
        Self { payload: bytemuck::bytes_of(payload).chunks(4).map(word).collect(), ..self }
    }
}
