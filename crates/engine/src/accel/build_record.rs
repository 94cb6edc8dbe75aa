//! A contiguous range of references that the builder of a tree divides or makes a leaf.

use std::ops::Range;

use crate::accel::prim_ref::{PrimRef, bounds_of, half_area};
use crate::geometry::Bounds;
use crate::math::f32x4::F32x4;
use crate::math::f32x8::F32x8Ops;

/// A contiguous range of primitive references during a build.
#[derive(Clone, Copy, Debug)]
pub(super) struct BuildRecord {
    /// The box around all of them, stored as in a [`PrimRef`].
    corners: [f32; 8],
    /// The box around twice their centroids: minimum, then maximum.
    pub centroid_bounds: [F32x4; 2],
    /// Half the surface area of the box around all of them.
    pub half_area: f32,
    /// The start of the range.
    first: u32,
    count: u32,
    /// Whether the range becomes a leaf.
    pub is_leaf: bool,
}

impl BuildRecord {
    /// A record of no references.
    pub(super) const EMPTY: Self = Self {
        corners: PrimRef::EMPTY.0,
        centroid_bounds: [F32x4::ZERO; 2],
        half_area: 0.0,
        first: 0,
        count: 0,
        is_leaf: false,
    };

    /// Makes the record of a range that starts at `first`.
    #[inline(always)]
    pub(super) fn new<E: F32x8Ops>(simd: E, prim_refs: &[PrimRef], first: usize) -> Self {
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

    /// The record of this range and the one behind it.
    pub(super) fn followed_by(&self, next: &Self) -> Self {
        let mut corners = self.corners;
        for (corner, &other) in corners.iter_mut().zip(&next.corners) {
            *corner = if other < *corner { other } else { *corner };
        }
        let [low, high] = self.centroid_bounds;
        let [next_low, next_high] = next.centroid_bounds;
        Self {
            corners,
            centroid_bounds: [next_low.relaxed_min(low), next_high.relaxed_max(high)],
            half_area: half_area(&corners),
            first: self.first,
            count: self.count + next.count,
            is_leaf: false,
        }
    }

    /// The record of a range that starts at `first` instead.
    #[inline(always)]
    pub(super) fn starting_at(self, first: usize) -> Self {
        Self { first: first as u32, ..self }
    }

    /// The start of the range.
    #[inline(always)]
    pub(super) fn first(&self) -> usize {
        self.first as usize
    }

    /// The number of references.
    pub(super) fn count(&self) -> usize {
        self.count as usize
    }

    /// The range of the references.
    #[inline(always)]
    pub(super) fn range(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// The box around all references.
    pub(super) fn bounds(&self) -> Bounds {
        bounds_of(&self.corners)
    }

    /// Twice the extent of the centroids on each axis.
    #[inline(always)]
    pub(super) fn centroid_extent2(&self) -> [f32; 4] {
        (self.centroid_bounds[1] - self.centroid_bounds[0]).to_array()
    }
}
