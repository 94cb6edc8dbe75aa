//! The binned SAH builder: divides a set of boxes among the children of a wide node.
//!
//! A set is split in two repeatedly, each time at the plane across an axis that the surface area
//! heuristic (SAH) finds cheapest. Candidate planes lie between bins, into which the boxes'
//! centroids are counted (I. Wald, *On fast Construction of SAH-based Bounding Volume Hierarchies*,
//! 2007).

use std::ops::Range;

use smallvec::SmallVec;

use crate::accel::node::WIDTH;
use crate::geometry::Bounds;
use crate::math::f32x4::F32x4;
use crate::math::f32x8::F32x8Ops;

/// A reference to a primitive: its number and its box. It is stored as the minimum corner, the
/// number and the negated maximum corner, so that one eight-lane minimum makes the union of two
/// boxes.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct PrimRef([f32; 8]);

const INF: f32 = f32::INFINITY;

/// The coordinate that stands for infinity: finite coordinates lie in the unit cube.
pub(super) const INFINITY_PROXY: f32 = 2.0;

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

impl PrimRef {
    /// An empty box with number 0: the neutral element of [`PrimRef::union`].
    pub(super) const EMPTY: Self = Self([INF, INF, INF, 0.0, INF, INF, INF, 0.0]);

    /// Makes a reference from a box and a primitive number.
    #[inline(always)]
    pub(super) fn new(&Bounds { min, max }: &Bounds, number: u32) -> Self {
        Self([min[0], min[1], min[2], f32::from_bits(number), -max[0], -max[1], -max[2], 0.0])
    }

    /// Makes a reference from the minimum corner, the negated maximum corner and the number.
    #[inline(always)]
    pub(super) fn from_corners([low, negated_high]: [F32x4; 2], number: u32) -> Self {
        let ([a, b, c, _], [d, e, f, _]) = (low.to_array(), negated_high.to_array());
        Self([a, b, c, f32::from_bits(number), d, e, f, 0.0])
    }

    /// Replaces the number.
    #[inline(always)]
    pub(super) fn with_number(self, number: u32) -> Self {
        let mut corners = self.0;
        corners[3] = f32::from_bits(number);
        Self(corners)
    }

    /// The union of two boxes, with number 0.
    #[inline(always)]
    pub(super) fn union(&self, other: &Self) -> Self {
        let low = self.low().relaxed_min(other.low());
        Self::from_corners([low, self.negated_high().relaxed_min(other.negated_high())], 0)
    }

    /// The number of the primitive.
    #[inline(always)]
    pub(super) fn number(&self) -> u32 {
        self.0[3].to_bits()
    }

    /// The box of the primitive.
    #[inline(always)]
    pub(super) fn bounds(&self) -> Bounds {
        bounds_of(&self.0)
    }

    /// The minimum corner; 0 in the fourth lane.
    #[inline(always)]
    pub(super) fn low(&self) -> F32x4 {
        let [x, y, z, ..] = self.0;
        F32x4::new([x, y, z, 0.0])
    }

    /// The negated maximum corner; 0 in the fourth lane.
    #[inline(always)]
    pub(super) fn negated_high(&self) -> F32x4 {
        let [.., x, y, z, w] = self.0;
        F32x4::new([x, y, z, w])
    }

    /// Twice the centroid.
    #[inline(always)]
    fn center2(&self) -> F32x4 {
        self.low() - self.negated_high()
    }

    /// Twice the centroid on one axis.
    #[inline(always)]
    fn center2_on(&self, axis: usize) -> f32 {
        self.0[axis] - self.0[axis + 4]
    }
}

/// Decodes the corners of a [`PrimRef`].
#[inline(always)]
fn bounds_of(&[a, b, c, _, d, e, f, _]: &[f32; 8]) -> Bounds {
    Bounds { min: [a, b, c], max: [-d, -e, -f] }
}

/// Half the surface area of a box whose corners are stored as in a [`PrimRef`]. It only ranks
/// splits.
#[inline(always)]
fn half_area(&[a, b, c, _, d, e, f, _]: &[f32; 8]) -> f32 {
    // The extents, negated.
    let (x, y, z) = (a + d, b + e, c + f);
    x * y + y * z + z * x
}

/// A contiguous range of primitive references during a build.
#[derive(Clone, Copy, Debug)]
pub(super) struct BuildRecord {
    /// The box around all of them, stored as in a [`PrimRef`].
    corners: [f32; 8],
    /// The box around twice their centroids: minimum, then maximum.
    centroid_bounds: [F32x4; 2],
    half_area: f32,
    /// The start of the range.
    first: u32,
    count: u32,
    /// Whether the range becomes a leaf.
    is_leaf: bool,
}

impl BuildRecord {
    /// A record of no references.
    const EMPTY: Self = Self {
        corners: PrimRef::EMPTY.0,
        centroid_bounds: [F32x4::ZERO; 2],
        half_area: 0.0,
        first: 0,
        count: 0,
        is_leaf: false,
    };

    /// Makes the record of a range that starts at `first`.
    #[inline(always)]
    fn new<E: F32x8Ops>(simd: E, prim_refs: &[PrimRef], first: usize) -> Self {
        let mut corners = simd.splat(f32::INFINITY);
        let mut centroid_bounds = [F32x4::splat(f32::INFINITY), F32x4::splat(f32::NEG_INFINITY)];
        for prim_ref in prim_refs {
            corners = simd.min(simd.load(&prim_ref.0), corners);
            let center2 = prim_ref.center2();
            centroid_bounds =
                [center2.relaxed_min(centroid_bounds[0]), center2.relaxed_max(centroid_bounds[1])];
        }
        let corners = simd.to_array(corners);
        let half_area = half_area(&corners);
        let (first, count) = (first as u32, prim_refs.len() as u32);
        Self { corners, centroid_bounds, half_area, first, count, is_leaf: false }
    }

    /// The number of references.
    pub(super) fn count(&self) -> usize {
        self.count as usize
    }

    /// Whether the range becomes a leaf.
    pub(super) fn is_leaf(&self) -> bool {
        self.is_leaf
    }

    /// The range of the references.
    #[inline(always)]
    fn range(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// The box around all references.
    pub(super) fn bounds(&self) -> Bounds {
        bounds_of(&self.corners)
    }

    /// Twice the extent of the centroids on each axis.
    #[inline(always)]
    fn centroid_extent2(&self) -> [f32; 4] {
        (self.centroid_bounds[1] - self.centroid_bounds[0]).to_array()
    }
}

/// The axis of the largest of the first three components.
#[inline(always)]
fn longest_axis([x, y, z, _]: [f32; 4]) -> usize {
    let first = if y > x { 1 } else { 0 };
    if z > x.max(y) { 2 } else { first }
}

/// The number of bins on an axis; a power of two.
const BINS: usize = 16;
/// The number of bins for at most [`MAX_SINGLE_AXIS`] boxes, which are binned on the longest axis
/// only.
const FEW_BINS: usize = 8;
const MAX_SINGLE_AXIS: usize = 128;
/// Up to this many boxes are sorted instead of binned; the number of lanes.
const MAX_SORTED: usize = 8;
/// Of more boxes than this only a sample is binned.
const SAMPLE_SIZE: usize = 256;
/// 1.5 * 2^23: a sum with it has the integer part in its low mantissa bits.
const TO_INTEGER: f32 = 12_582_912.0;
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

/// A split plane between two bins.
struct BinSplit {
    axis: usize,
    /// The last bin on the left.
    last_left: usize,
    mapping: BinMapping,
}

/// Maps twice a centroid to its bin on each axis.
#[derive(Clone, Copy)]
struct BinMapping {
    offset: F32x4,
    scale: F32x4,
}

impl BinMapping {
    /// The bin on each axis, as a sum with [`TO_INTEGER`] that [`bin_in`] decodes.
    #[inline(always)]
    fn bins(self, center2: F32x4) -> F32x4 {
        ((center2 - self.offset) * self.scale - F32x4::splat(0.5)) + F32x4::splat(TO_INTEGER)
    }
}

/// [`BinMapping::bins`] on one axis.
#[inline(always)]
fn bin_on_axis(center2: f32, offset: f32, scale: f32) -> f32 {
    ((center2 - offset) * scale - 0.5) + TO_INTEGER
}

/// Decodes the bin in a sum with [`TO_INTEGER`].
#[inline(always)]
fn bin_in(sum: f32) -> usize {
    sum.to_bits() as usize & (BINS - 1)
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
    pub(super) fn records(&self) -> impl Iterator<Item = &BuildRecord> {
        self.order.iter().map(|&at| &self.records[usize::from(at)])
    }

    /// Divides at least two references among the children of a node, reordering them. There is one
    /// record if all of them make a leaf. `median_split` splits at the median instead of by cost.
    #[inline(always)]
    pub(super) fn divide<E: F32x8Ops>(
        &mut self,
        simd: E,
        prim_refs: &mut [PrimRef],
        cost: &SahCost,
        median_split: bool,
    ) {
        self.records[0] = BuildRecord::new(simd, prim_refs, 0);
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
            if whole.count == 1 {
                self.records[at].is_leaf = true;
                continue;
            }
            let these = &mut prim_refs[whole.range()];
            let half = self.split(simd, these, &whole, cost, median_split);
            let (left, right) = these.split_at(half);
            let left = BuildRecord::new(simd, left, whole.first as usize);
            let right = BuildRecord::new(simd, right, whole.first as usize + half);
            let sah = |record: &BuildRecord| record.half_area * cost.leaf(record.count());
            if !must_split && sah(&left) + sah(&right) >= cost.split_below * sah(&whole) {
                self.records[at].is_leaf = true;
                continue;
            }
            let added = self.order.len();
            self.records[at] = left;
            self.records[added] = right;
            let position = self.order.iter().position(|&one| usize::from(one) == at).unwrap_or(0);
            self.order.insert(position + 1, added as u8);
        }
        for record in &mut self.records[..self.order.len()] {
            record.is_leaf |= is_leaf(&prim_refs[record.range()], record, cost);
        }
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

/// Moves the boxes on the left of a split before the others; returns their number. It is written
/// without a branch that depends on a box, as half of those would be mispredicted.
#[inline(always)]
#[allow(clippy::manual_swap, reason = "`swap` goes through memory")]
fn partition(prim_refs: &mut [PrimRef], split: &BinSplit) -> usize {
    let BinMapping { offset, scale } = split.mapping;
    let (offset, scale) = (offset.to_array()[split.axis], scale.to_array()[split.axis]);
    let last = TO_INTEGER + split.last_left as u32 as f32;
    let mut left = 0;
    for at in 0..prim_refs.len() {
        let is_left = bin_on_axis(prim_refs[at].center2_on(split.axis), offset, scale) <= last;
        // All boxes from `left` up to here lie on the right.
        let prim_ref = prim_refs[at];
        prim_refs[at] = prim_refs[left];
        prim_refs[left] = prim_ref;
        left += usize::from(is_left);
    }
    left
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
