//! A split of references between two bins of their centroids.

use crate::accel::prim_ref::PrimRef;
use crate::math::f32x4::F32x4;

/// The number of bins on an axis; a power of two.
pub(super) const BINS: usize = 16;
/// 1.5 * 2^23: a sum with it has the integer part in its low mantissa bits.
const TO_INTEGER: f32 = 12_582_912.0;

/// A split plane between two bins.
pub(super) struct BinSplit {
    /// The axis that it lies across.
    pub axis: usize,
    /// The last bin on the left.
    pub last_left: usize,
    /// Maps centroids to bins.
    pub mapping: BinMapping,
}

/// Maps twice a centroid to its bin on each axis.
#[derive(Clone, Copy)]
pub(super) struct BinMapping {
    /// What is subtracted first.
    pub offset: F32x4,
    /// The number of bins a unit.
    pub scale: F32x4,
}

impl BinMapping {
    /// The bin on each axis, as a sum with [`TO_INTEGER`] that [`bin_in`] decodes.
    #[inline(always)]
    pub(super) fn bins(self, center2: F32x4) -> F32x4 {
        ((center2 - self.offset) * self.scale - F32x4::splat(0.5)) + F32x4::splat(TO_INTEGER)
    }
}

/// [`BinMapping::bins`] on one axis.
#[inline(always)]
pub(super) fn bin_on_axis(center2: f32, offset: f32, scale: f32) -> f32 {
    ((center2 - offset) * scale - 0.5) + TO_INTEGER
}

/// Decodes the bin in a sum with [`TO_INTEGER`].
#[inline(always)]
pub(super) fn bin_in(sum: f32) -> usize {
    sum.to_bits() as usize & (BINS - 1)
}

/// Moves the boxes on the left of a split before the others; returns their number. It is written
/// without a branch that depends on a box, as half of those would be mispredicted.
#[inline(always)]
#[allow(clippy::manual_swap, reason = "`swap` goes through memory")]
pub(super) fn partition(prim_refs: &mut [PrimRef], split: &BinSplit) -> usize {
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
