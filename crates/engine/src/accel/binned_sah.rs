//! The binned SAH builder: divides a set of boxes among the children of a wide node.
//!
//! A set is split in two repeatedly, each time at the plane across an axis that the surface area
//! heuristic (SAH) finds cheapest. Candidate planes lie between bins, into which the boxes'
//! centroids are counted (I. Wald, *On fast Construction of SAH-based Bounding Volume Hierarchies*,
//! 2007).

use std::ops::Deref;

use smallvec::SmallVec;

use crate::accel::bin_split::{BINS, BinMapping, BinSplit, bin_in, bin_on_axis, partition};
use crate::accel::build_record::BuildRecord;
use crate::accel::build_threads::BuildThreads;
use crate::accel::chunked_partition::{MAX_UNCHUNKED, partition_chunks, record_of_chunks};
use crate::accel::node::WIDTH;
use crate::accel::prim_ref::{PrimRef, half_area};
use crate::math::f32x4::F32x4;
use crate::math::f32x8::F32x8Ops;

/// The cost model of the surface area heuristic, in units of one inner node's test.
#[derive(Clone, Copy, Debug)]
pub(super) struct SahCost {
    /// The largest number of primitives in a leaf; a power of two.
    pub max_leaf_size: usize,
    /// The cost of visiting one leaf.
    pub traversal: f32,
    /// The cost of testing one primitive.
    pub intersection: f32,
    /// A set that fits into one leaf is split only if the cost of both parts is below this share of
    /// the cost of the leaf.
    pub split_below: f32,
}

impl SahCost {
    /// The cost of `count` primitives in as few leaves as hold them.
    #[inline(always)]
    pub(super) fn leaf(&self, count: usize) -> f32 {
        let leaves = (count + self.max_leaf_size - 1) >> self.max_leaf_size.trailing_zeros();
        leaves as u32 as f32 * self.traversal + count as u32 as f32 * self.intersection
    }
}

/// The axis of the largest of the first three components.
#[inline(always)]
fn longest_axis([x, y, z, _]: [f32; 4]) -> usize {
    let first = if y > x { 1 } else { 0 };
    if z > x.max(y) { 2 } else { first }
}

/// The number of bins for at most [`MAX_SINGLE_AXIS`] boxes, which are binned on the longest axis
/// only.
const FEW_BINS: usize = 8;
const MAX_SINGLE_AXIS: usize = 128;
/// Up to this many boxes are sorted instead of binned; the number of lanes.
const MAX_SORTED: usize = 8;
/// Of more boxes than this only a sample is binned.
const SAMPLE_SIZE: usize = 256;
/// An axis on which twice the centroids' extent is at most this is not binned.
const MIN_EXTENT: f32 = 1e-30;

/// Divides the references of one node at a time; keeps its buffers between calls.
#[derive(Debug)]
pub(super) struct BinnedSahBuilder {
    records: [BuildRecord; WIDTH],
    /// The indices of the records, in the order of their ranges.
    order: SmallVec<[u8; WIDTH]>,
    extents: [[PrimRef; BINS]; 3],
    counts: [[u32; BINS]; 3],
}

/// The ranges into which the references of a node are divided, in their order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Children {
    records: [BuildRecord; WIDTH],
    count: usize,
}

impl Deref for Children {
    type Target = [BuildRecord];

    #[inline(always)]
    fn deref(&self) -> &[BuildRecord] {
        &self.records[..self.count]
    }
}

impl BinnedSahBuilder {
    pub(super) fn new() -> Self {
        Self {
            records: [BuildRecord::EMPTY; WIDTH],
            order: SmallVec::new(),
            extents: [[PrimRef::EMPTY; BINS]; 3],
            counts: [[0; BINS]; 3],
        }
    }

    /// The records that [`Self::divide`] made last, in the order of their ranges.
    #[inline(always)]
    pub(super) fn children(&self) -> Children {
        let mut records = [self.records[0]; WIDTH];
        for (slot, &at) in self.order.iter().enumerate() {
            records[slot] = self.records[usize::from(at)];
        }
        Children { records, count: self.order.len() }
    }

    /// Divides at least two references, those of `whole`, among the children of a node, reordering
    /// them. There is one record if all of them make a leaf. `median_split` splits at the median
    /// instead of by cost. Several threads divide many references together, into the same records
    /// in the same order.
    #[inline(always)]
    pub(super) fn divide<E: F32x8Ops>(
        &mut self,
        simd: E,
        prim_refs: &mut [PrimRef],
        whole: &BuildRecord,
        cost: &SahCost,
        median_split: bool,
        threads: BuildThreads,
    ) {
        self.records[0] = whole.starting_at(0);
        self.order.clear();
        self.order.push(0);
        while self.order.len() < WIDTH {
            // Split the largest record that is too large for a leaf, then the largest that may be
            // one.
            let mut chosen: Option<(usize, bool, f32)> = None;
            for (at, record) in self.records[..self.order.len()].iter().enumerate() {
                let (must_split, area) = (record.count() > cost.max_leaf_size, record.half_area);
                let better =
                    chosen.is_none_or(|(_, other_must_split, least)| match (must_split, other_must_split) {
                        (true, false) => true,
                        (false, true) => false,
                        _ => area > least,
                    });
                if !record.is_leaf && better {
                    chosen = Some((at, must_split, area));
                }
            }
            let Some((at, must_split, _)) = chosen else { break };
            let whole = self.records[at];
            if whole.count() == 1 {
                self.records[at].is_leaf = true;
                continue;
            }
            let these = &mut prim_refs[whole.range()];
            if these.len() > MAX_UNCHUNKED {
                let [left, right] = self.split_many(simd, these, &whole, cost, median_split, threads);
                self.replace(at, left, right);
                continue;
            }
            let half = self.split(simd, these, &whole, cost, median_split);
            let (left, right) = these.split_at(half);
            let left = BuildRecord::new(simd, left, whole.first());
            let right = BuildRecord::new(simd, right, whole.first() + half);
            let sah = |record: &BuildRecord| record.half_area * cost.leaf(record.count());
            if !must_split && sah(&left) + sah(&right) >= cost.split_below * sah(&whole) {
                self.records[at].is_leaf = true;
                continue;
            }
            self.replace(at, left, right);
        }
        for record in &mut self.records[..self.order.len()] {
            record.is_leaf |= is_leaf(&prim_refs[record.range()], record, cost);
        }
    }

    /// Replaces a record by those of both sides of a split.
    #[inline(always)]
    fn replace(&mut self, at: usize, left: BuildRecord, right: BuildRecord) {
        let added = self.order.len();
        self.records[at] = left;
        self.records[added] = right;
        let position = self.order.iter().position(|&one| usize::from(one) == at).unwrap_or(0);
        self.order.insert(position + 1, added as u8);
    }

    /// Splits at least two references, reordering them; returns the number on the left.
    #[inline(always)]
    fn split<E: F32x8Ops>(
        &mut self,
        simd: E,
        prim_refs: &mut [PrimRef],
        record: &BuildRecord,
        cost: &SahCost,
        median_split: bool,
    ) -> usize {
        if prim_refs.len() == 2 {
            return 1;
        }
        let centroid_extent2 = record.centroid_extent2();
        let axis = longest_axis(centroid_extent2);
        if median_split || centroid_extent2[axis] <= MIN_EXTENT {
            return split_at_median(prim_refs, axis);
        }
        if prim_refs.len() <= MAX_SORTED {
            return sort_and_split(simd, prim_refs, axis, cost);
        }
        let split = if prim_refs.len() <= MAX_SINGLE_AXIS {
            self.best_split_on_axis(simd, prim_refs, record, axis, cost)
        } else {
            self.best_split(simd, prim_refs, record, cost)
        };
        let Some(split) = split else { return split_at_median(prim_refs, axis) };
        let left = partition(prim_refs, &split);
        if left == 0 || left == prim_refs.len() { split_at_median(prim_refs, axis) } else { left }
    }

    /// Splits more than [`MAX_UNCHUNKED`] references, reordering them; makes the records of both
    /// sides.
    #[inline(always)]
    fn split_many<E: F32x8Ops>(
        &mut self,
        simd: E,
        prim_refs: &mut [PrimRef],
        record: &BuildRecord,
        cost: &SahCost,
        median_split: bool,
        threads: BuildThreads,
    ) -> [BuildRecord; 2] {
        let (first, count) = (record.first(), prim_refs.len());
        let centroid_extent2 = record.centroid_extent2();
        let axis = longest_axis(centroid_extent2);
        if !median_split
            && centroid_extent2[axis] > MIN_EXTENT
            && let Some(split) = self.best_split(simd, prim_refs, record, cost)
        {
            let [left, right] = partition_chunks(prim_refs, &split, threads);
            let half = left.count();
            if half != 0 && half != count {
                return [left.starting_at(first), right.starting_at(first + half)];
            }
        }
        let half = split_at_median(prim_refs, axis);
        let (left, right) = prim_refs.split_at(half);
        let (left, right) = (record_of_chunks(left, threads), record_of_chunks(right, threads));
        [left.starting_at(first), right.starting_at(first + half)]
    }

    /// Finds the cheapest plane on all three axes; `None` if no plane separates the boxes.
    #[inline(always)]
    fn best_split<E: F32x8Ops>(
        &mut self,
        simd: E,
        prim_refs: &[PrimRef],
        record: &BuildRecord,
        cost: &SahCost,
    ) -> Option<BinSplit> {
        let offset = record.centroid_bounds[0];
        let centroid_extent2 = record.centroid_extent2();
        let scale = |axis: usize| {
            if centroid_extent2[axis] > MIN_EXTENT {
                (BINS as f32 - 0.01) / centroid_extent2[axis]
            } else {
                0.0
            }
        };
        let mapping = BinMapping { offset, scale: F32x4::new([scale(0), scale(1), scale(2), 0.0]) };
        for axis in 0..3 {
            self.clear::<BINS>(axis);
        }
        for prim_ref in prim_refs.iter().step_by((prim_refs.len() / SAMPLE_SIZE).max(1)) {
            let corners = simd.load(&prim_ref.0);
            let [x, y, z, _] = mapping.bins(prim_ref.center2()).to_array();
            for (axis, sum) in [x, y, z].into_iter().enumerate() {
                self.add_to_bin(simd, axis, bin_in(sum), corners);
            }
        }
        let mut best = (f32::INFINITY, 0, 0);
        for (axis, &size) in centroid_extent2[..3].iter().enumerate() {
            if size > MIN_EXTENT {
                let (sah, last) = self.sweep::<E, BINS>(simd, axis, cost);
                if sah < best.0 {
                    best = (sah, axis, last);
                }
            }
        }
        let (sah, axis, last) = best;
        (sah < f32::INFINITY).then_some(BinSplit { axis, last_left: last, mapping })
    }

    /// Finds the cheapest plane across one axis; `None` if no plane separates the boxes.
    #[inline(always)]
    fn best_split_on_axis<E: F32x8Ops>(
        &mut self,
        simd: E,
        prim_refs: &[PrimRef],
        record: &BuildRecord,
        axis: usize,
        cost: &SahCost,
    ) -> Option<BinSplit> {
        self.clear::<FEW_BINS>(axis);
        let offset = record.centroid_bounds[0];
        let scale = (FEW_BINS as f32 - 0.01) / record.centroid_extent2()[axis];
        let first = offset.to_array()[axis];
        for prim_ref in prim_refs {
            let bin = bin_in(bin_on_axis(prim_ref.center2_on(axis), first, scale));
            self.add_to_bin(simd, axis, bin, simd.load(&prim_ref.0));
        }
        let (sah, last) = self.sweep::<E, FEW_BINS>(simd, axis, cost);
        let mapping = BinMapping { offset, scale: F32x4::splat(scale) };
        (sah < f32::INFINITY).then_some(BinSplit { axis, last_left: last, mapping })
    }

    #[inline(always)]
    fn clear<const COUNT: usize>(&mut self, axis: usize) {
        self.extents[axis][..COUNT].fill(PrimRef::EMPTY);
        self.counts[axis][..COUNT].fill(0);
    }

    #[inline(always)]
    fn add_to_bin<E: F32x8Ops>(&mut self, simd: E, axis: usize, bin: usize, corners: E::F32x8) {
        let extent = &mut self.extents[axis][bin];
        extent.0 = simd.to_array(simd.min(corners, simd.load(&extent.0)));
        self.counts[axis][bin] += 1;
    }

    /// The cheapest plane across an axis: its cost and the last bin on its left.
    #[inline(always)]
    fn sweep<E: F32x8Ops, const COUNT: usize>(&self, simd: E, axis: usize, cost: &SahCost) -> (f32, usize) {
        let (extents, counts) = (&self.extents[axis], &self.counts[axis]);
        // The cost of what lies right of the plane behind each bin.
        let mut right = [f32::INFINITY; COUNT];
        let (mut extent, mut count) = (simd.splat(f32::INFINITY), 0);
        for bin in (1..COUNT).rev() {
            extent = simd.min(simd.load(&extents[bin].0), extent);
            count += counts[bin];
            if count > 0 {
                right[bin - 1] = half_area(&simd.to_array(extent)) * cost.leaf(count as usize);
            }
        }
        let mut best = (f32::INFINITY, 0);
        let (mut extent, mut count) = (simd.splat(f32::INFINITY), 0);
        for bin in 0..COUNT - 1 {
            if counts[bin] == 0 {
                continue;
            }
            extent = simd.min(simd.load(&extents[bin].0), extent);
            count += counts[bin];
            let all = half_area(&simd.to_array(extent)) * cost.leaf(count as usize) + right[bin];
            if all < best.0 {
                best = (all, bin);
            }
        }
        best
    }
}

/// Sorts at most [`MAX_SORTED`] boxes along an axis; returns how many lie left of the cheapest
/// plane.
#[inline(always)]
fn sort_and_split<E: F32x8Ops>(simd: E, prim_refs: &mut [PrimRef], axis: usize, cost: &SahCost) -> usize {
    let count = prim_refs.len();
    let mut centers2 = [f32::INFINITY; MAX_SORTED];
    let mut old = [prim_refs[0]; MAX_SORTED];
    for (at, prim_ref) in prim_refs.iter().enumerate() {
        centers2[at] = prim_ref.center2_on(axis);
        old[at] = *prim_ref;
    }
    let all = simd.load(&centers2);
    for at in 0..count {
        // A stable counting sort: it goes behind smaller boxes and equal ones that precede it.
        let before = (1u32 << at) - 1;
        let this = simd.splat(centers2[at]);
        let not_greater = simd.cmp_ge(this, all) & before;
        let less = !simd.cmp_ge(all, this) & !before;
        prim_refs[((not_greater | less) & 0xFF).count_ones() as usize] = old[at];
    }
    let mut right = [0.0; MAX_SORTED];
    let mut extent = simd.splat(f32::INFINITY);
    for at in (1..count).rev() {
        extent = simd.min(simd.load(&prim_refs[at].0), extent);
        right[at] = half_area(&simd.to_array(extent)) * cost.leaf(count - at);
    }
    let mut best = (f32::INFINITY, count / 2);
    let mut extent = simd.splat(f32::INFINITY);
    for at in 1..count {
        extent = simd.min(simd.load(&prim_refs[at - 1].0), extent);
        let sah = half_area(&simd.to_array(extent)) * cost.leaf(at) + right[at];
        if sah < best.0 {
            best = (sah, at);
        }
    }
    best.1
}

/// Whether one leaf costs at most as much as a node over leaves of one primitive each.
#[inline(always)]
fn is_leaf(prim_refs: &[PrimRef], record: &BuildRecord, cost: &SahCost) -> bool {
    let (count, area) = (record.count(), record.half_area);
    let single = || prim_refs.iter().map(|prim_ref| half_area(&prim_ref.0)).sum::<f32>() * cost.leaf(1);
    count <= cost.max_leaf_size && (count == 1 || area + single() >= area * cost.leaf(count))
}

/// Splits at the median along an axis; returns the number on the left.
#[cold]
fn split_at_median(prim_refs: &mut [PrimRef], axis: usize) -> usize {
    let half = prim_refs.len() / 2;
    prim_refs.select_nth_unstable_by(half, |a, b| {
        a.center2_on(axis).total_cmp(&b.center2_on(axis)).then(a.number().cmp(&b.number()))
    });
    half
}
