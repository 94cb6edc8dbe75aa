//! Indices outside their arrays, kept for the report of the access that traps.
//!
//! Computing such an index stops no lane: what it gives says only that it is outside. The access
//! that follows it traps, and its report tells which index that was.

use crate::machine::lanes::Lanes;
use crate::machine::lanes::Mask;

/// The indices of a batch that were outside their arrays.
#[derive(Clone, Debug)]
pub struct MissedIndices<const W: usize> {
    all: Vec<Missed<W>>,
    /// How many times there were some.
    times: u64,
}

/// By lane, the last index outside its array at an operation.
#[derive(Clone, Debug)]
struct Missed<const W: usize> {
    op: u32,
    indices: [u32; W],
    /// When it was, counted from 1; 0 for never.
    times: [u64; W],
}

impl<const W: usize> Default for MissedIndices<W> {
    fn default() -> Self {
        Self { all: Vec::new(), times: 0 }
    }
}

impl<const W: usize> MissedIndices<W> {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.all.clear();
    }

    /// Remembers the indices of some lanes at an operation.
    #[cold]
    pub fn remember(&mut self, op: u32, lanes: Mask<W>, indices: &Lanes<W>) {
        self.times += 1;
        let at = self.all.iter().position(|missed| missed.op == op).unwrap_or_else(|| {
            self.all.push(Missed { op, indices: [0; W], times: [0; W] });
            self.all.len() - 1
        });
        for lane in lanes.lanes() {
            self.all[at].indices[lane] = indices.0[lane];
            self.all[at].times[lane] = self.times;
        }
    }

    /// When a lane's index was outside its array last at an operation, and that index.
    pub fn last(&self, op: u32, lane: usize) -> Option<(u64, u32)> {
        let missed = self.all.iter().find(|missed| missed.op == op)?;
        let when = missed.times[lane];
        (when > 0).then_some((when, missed.indices[lane]))
    }
}
