//! Partitions many references in chunks, which several threads share.
//!
//! Each chunk is partitioned by itself. Then what lies on the wrong side of the boundary between
//! the two sides of all chunks is exchanged. Chunks have one size, and are combined in their order:
//! the outcome does not depend on the threads.

use crate::accel::bin_split::{BinSplit, partition};
use crate::accel::build_record::BuildRecord;
use crate::accel::build_threads::{BuildThreads, CHUNK};
use crate::accel::prim_ref::PrimRef;
use crate::math::lane_ops::{CpuTier, LaneOps, LaneTask};

/// More references than this are partitioned in chunks. Below, whole subtrees keep the threads
/// busy.
pub(super) const MAX_UNCHUNKED: usize = 8 * CHUNK;

/// Makes the record of a chunk.
struct RecordOf<'a>(&'a [PrimRef]);

impl LaneTask for RecordOf<'_> {
    type Output = BuildRecord;

    #[inline(always)]
    fn run<V: LaneOps>(self, simd: V) -> BuildRecord {
        BuildRecord::new(simd, self.0, 0)
    }
}

/// Partitions a chunk; makes the records of both sides.
struct Partition<'a> {
    chunk: &'a mut [PrimRef],
    split: &'a BinSplit,
}

impl LaneTask for Partition<'_> {
    type Output = [BuildRecord; 2];

    #[inline(always)]
    fn run<V: LaneOps>(self, simd: V) -> [BuildRecord; 2] {
        let left = partition(self.chunk, self.split);
        let (left, right) = self.chunk.split_at(left);
        [BuildRecord::new(simd, left, 0), BuildRecord::new(simd, right, 0)]
    }
}

/// The record of all references, which starts at 0.
#[inline(never)]
pub(super) fn record_of_chunks(prim_refs: &[PrimRef], threads: BuildThreads) -> BuildRecord {
    let cpu_tier = CpuTier::new();
    let chunks = prim_refs.chunks(CHUNK).collect();
    let records = threads.map(chunks, |chunk| cpu_tier.run(RecordOf(chunk)));
    records.iter().skip(1).fold(records[0], |all, next| all.followed_by(next))
}

/// Moves the boxes on the left of a split before the others; makes the records of both sides, which
/// start at 0.
#[inline(never)]
pub(super) fn partition_chunks(
    prim_refs: &mut [PrimRef],
    split: &BinSplit,
    threads: BuildThreads,
) -> [BuildRecord; 2] {
    let cpu_tier = CpuTier::new();
    let chunks = prim_refs.chunks_mut(CHUNK).collect();
    let records = threads.map(chunks, |chunk| cpu_tier.run(Partition { chunk, split }));
    let sides = [0, 1]
        .map(|side| records.iter().skip(1).fold(records[0][side], |all, next| all.followed_by(&next[side])));
    let swaps = misplaced(prim_refs, sides[0].count(), records.iter().map(|[left, _]| left.count()));
    threads.map(swaps, |(on_left, on_right)| on_left.swap_with_slice(on_right));
    sides
}

/// What has to be exchanged once each chunk is partitioned: slices on the left of `boundary` that
/// belong right of it, each with as long a one that belongs left. `lefts` counts for each chunk the
/// references that belong left.
fn misplaced(
    prim_refs: &mut [PrimRef],
    boundary: usize,
    lefts: impl Iterator<Item = usize>,
) -> Vec<(&mut [PrimRef], &mut [PrimRef])> {
    let (mut on_left, mut on_right) = (Vec::new(), Vec::new());
    let mut first = 0;
    for (chunk, left) in prim_refs.chunks_mut(CHUNK).zip(lefts) {
        // How many of the chunk lie before the boundary.
        let before = boundary.saturating_sub(first).min(chunk.len());
        first += chunk.len();
        if left <= before {
            on_left.push(&mut chunk[left..before]);
        } else {
            on_right.push(&mut chunk[before..left]);
        }
    }
    let mut pairs = Vec::new();
    let (mut on_left, mut on_right) = (on_left.into_iter(), on_right.into_iter());
    let (mut a, mut b): (&mut [PrimRef], &mut [PrimRef]) = (&mut [], &mut []);
    loop {
        if a.is_empty() {
            let Some(next) = on_left.next() else { break };
            a = next;
        } else if b.is_empty() {
            let Some(next) = on_right.next() else { break };
            b = next;
        } else {
            let count = a.len().min(b.len());
            let ((this, rest), (other, other_rest)) = (a.split_at_mut(count), b.split_at_mut(count));
            pairs.push((this, other));
            (a, b) = (rest, other_rest);
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::bin_split::{BINS, BinMapping};
    use crate::geometry::Bounds;
    use crate::math::f32x4::F32x4;
    use crate::math::random::Random;

    #[test]
    fn both_sides_are_whole_and_have_their_boxes() {
        let mut random = Random::new(5);
        // As many as make whole chunks, and others; splits with all on one side.
        for (count, last_left) in
            [(3 * CHUNK, 7), (2 * CHUNK + 1, 3), (5 * CHUNK - 9, 12), (7, 5), (3 * CHUNK, 0), (3 * CHUNK, 15)]
        {
            let mut prim_refs: Vec<PrimRef> = (0..count as u32)
                .map(|number| {
                    // The centroid is k + 1/2 twelfths, which is in bin k of bins that are as wide.
                    let x = (random.below(14) as f32 + 0.5 + 1.0) / 16.0;
                    let half = random.unit() / 64.0;
                    let (min, max) = ([x - half, 0.0, 0.0], [x + half, 1.0, random.unit()]);
                    PrimRef::new(&Bounds { min, max }, number)
                })
                .collect();
            let before = prim_refs.clone();
            let is_left = |one: &PrimRef| one.center2_on(0) / 2.0 * 16.0 < last_left as f32 + 1.0;
            let mapping = BinMapping { offset: F32x4::ZERO, scale: F32x4::splat(BINS as f32 / 2.0) };
            let split = BinSplit { axis: 0, last_left, mapping };
            let [left, right] = partition_chunks(&mut prim_refs, &split, BuildThreads::One);
            let boundary = before.iter().filter(|one| is_left(one)).count();
            assert_eq!([left.count(), right.count()], [boundary, count - boundary]);
            assert!(prim_refs[..boundary].iter().all(is_left), "{last_left}");
            assert!(!prim_refs[boundary..].iter().any(is_left), "{last_left}");
            for (side, record) in [(&prim_refs[..boundary], left), (&prim_refs[boundary..], right)] {
                let wanted = side.iter().fold(PrimRef::EMPTY, |all, one| all.union(one));
                assert_eq!(record.bounds(), wanted.bounds());
            }
            let all = before.iter().fold(PrimRef::EMPTY, |all, one| all.union(one));
            assert_eq!(record_of_chunks(&prim_refs, BuildThreads::One).bounds(), all.bounds());
            prim_refs.sort_by_key(PrimRef::number);
            let bits = |all: &[PrimRef]| all.iter().map(|one| one.0.map(f32::to_bits)).collect::<Vec<_>>();
            assert_eq!(bits(&prim_refs), bits(&before));
        }
    }
}
