//! Indices that were out of bounds, recorded for the report of the access that traps.
//!
//! Computing such an index stops no lane: the computed offset only says that it is out of bounds.
//! The access through the offset traps, and its report names the index.

use crate::machine::index::OpIndex;
use crate::machine::lanes::Lanes;
use crate::machine::lanes::Mask;

/// The indices of a batch that were outside their arrays, by operation.
#[derive(Clone, Debug)]
pub struct OutOfBoundsIndices<const W: usize> {
    all: Vec<LaneIndices<W>>,
    /// How many times indices were recorded.
    count: u64,
}

/// The last out-of-bounds index of each lane at an operation.
#[derive(Clone, Debug)]
struct LaneIndices<const W: usize> {
    op: OpIndex,
    indices: [u32; W],
    /// When each lane recorded its index, counted from 1; 0 for never.
    times: [u64; W],
}

impl<const W: usize> Default for OutOfBoundsIndices<W> {
    fn default() -> Self {
        Self { all: Vec::new(), count: 0 }
    }
}

impl<const W: usize> OutOfBoundsIndices<W> {
    /// Discards all indices.
    pub fn clear(&mut self) {
        self.all.clear();
    }

    /// Records the indices of some lanes at an operation.
    #[cold]
    pub fn record(&mut self, op: OpIndex, lanes: Mask<W>, indices: &Lanes<W>) {
        self.count += 1;
        let at = self.all.iter().position(|entry| entry.op == op).unwrap_or_else(|| {
            self.all.push(LaneIndices { op, indices: [0; W], times: [0; W] });
            self.all.len() - 1
        });
        for lane in lanes.lanes() {
            self.all[at].indices[lane] = indices.0[lane];
            self.all[at].times[lane] = self.count;
        }
    }

    /// The last out-of-bounds index of a lane at an operation, after when it was recorded.
    pub fn last(&self, op: OpIndex, lane: usize) -> Option<(u64, u32)> {
        let entry = self.all.iter().find(|entry| entry.op == op)?;
        let when = entry.times[lane];
        (when > 0).then_some((when, entry.indices[lane]))
    }
}
