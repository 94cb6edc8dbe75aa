//! The result of the f64 filter for four primitives at once, and its division with error bounds.

use crate::geometry::{Intersection, Surface};
use crate::math::error_bound::four_units;
use crate::math::f32x4::F32x4;
use crate::math::f64x4::F64x4Ops;

/// The mask of all lanes.
pub(super) const ALL: u32 = 0b1111;

/// The hits of a ray on four primitives, as far as the f64 filter decides them.
#[derive(Clone, Copy, Debug)]
pub struct Intersection4 {
    /// A mask of the primitives that are hit within the interval.
    pub(super) hits: u32,
    /// A mask of the primitives that the error bounds do not decide.
    pub(super) undecided: u32,
    /// A mask of the primitives that are hit on the second of the two surfaces.
    pub(super) second_surface: u32,
    /// The first and the second surface.
    pub(super) surfaces: [Surface; 2],
    pub(super) t: [f32; 4],
    pub(super) attributes: [[f32; 4]; 2],
}

impl Intersection4 {
    /// All four are missed.
    pub const MISSED: Self = Self {
        hits: 0,
        undecided: 0,
        second_surface: 0,
        surfaces: [Surface::Sphere; 2],
        t: [0.0; 4],
        attributes: [[0.0; 4]; 2],
    };

    /// A mask of the primitives that the ray may hit.
    #[inline(always)]
    pub fn maybe_hit_mask(&self) -> u32 {
        self.hits | self.undecided
    }

    /// A mask of the primitives that are undecided.
    #[inline(always)]
    pub fn undecided(&self) -> u32 {
        self.undecided
    }

    /// A mask of the primitives that are hit, of those in `masks`: one for primitives that are hit
    /// on the first surface, one for the second.
    #[inline(always)]
    pub fn hits_on(&self, masks: [u32; 2]) -> u32 {
        self.hits & (masks[0] & !self.second_surface | masks[1] & self.second_surface)
    }

    /// The hit of one of them; `None` if it is missed or undecided.
    #[inline(always)]
    pub fn hit(&self, lane: usize) -> Option<Intersection> {
        (self.hits >> (lane % 4) & 1 != 0).then(|| self.intersection(lane))
    }

    /// The hit of one of them that is hit.
    #[inline(always)]
    pub fn intersection(&self, lane: usize) -> Intersection {
        let [first, second] = &self.attributes;
        let lane = lane % 4;
        Intersection {
            t: self.t[lane],
            attributes: [first[lane], second[lane]],
            surface: self.surfaces[(self.second_surface >> lane & 1) as usize],
        }
    }
}

/// Computed values with lower and upper bounds of the exact ones.
#[derive(Clone, Copy)]
pub(super) struct Interval4<D: F64x4Ops> {
    pub value: D::F64x4,
    pub low: D::F64x4,
    pub high: D::F64x4,
}

impl<D: F64x4Ops> Interval4<D> {
    /// Makes bounds from computed numbers and their errors.
    #[inline(always)]
    pub(super) fn new(simd: D, value: D::F64x4, error: D::F64x4) -> Self {
        Self { value, low: simd.sub(value, error), high: simd.add(value, error) }
    }

    /// A mask of the lanes in which both bounds round to one `f32`, and the rounded numbers. These
    /// are made of the computed values, so that code that uses them does not wait for the bounds.
    #[inline(always)]
    pub(super) fn rounded(&self, simd: D) -> (u32, F32x4) {
        let [first, last] = self.rounded_bounds(simd);
        (first.cmp_ge(last), self.rounded_value(simd))
    }

    /// Both bounds, rounded. An `f32` that is above or below both of them is so for the exact
    /// number, too.
    #[inline(always)]
    pub(super) fn rounded_bounds(&self, simd: D) -> [F32x4; 2] {
        // No closure: one that is not inlined takes its vectors through memory.
        [F32x4::new(simd.to_f32(self.low)), F32x4::new(simd.to_f32(self.high))]
    }

    /// The computed values, rounded; without a sign where they are 0.
    #[inline(always)]
    pub(super) fn rounded_value(&self, simd: D) -> F32x4 {
        F32x4::new(simd.to_f32(self.value)) + F32x4::ZERO
    }
}

/// `math::error_bound::Divisor` in four lanes.
#[derive(Clone, Copy)]
pub(super) struct Divisor4<D: F64x4Ops> {
    simd: D,
    inverse: D::F64x4,
    /// Twice its own relative error, and the roundings of a quotient.
    relative_error: D::F64x4,
    max_inverse: D::F64x4,
    /// A mask of the lanes in which the relative error of the denominator is at most 1/2.
    pub is_certain: u32,
}

impl<D: F64x4Ops> Divisor4<D> {
    /// Prepares computed denominators with their errors.
    #[inline(always)]
    pub(super) fn new(simd: D, denominator: D::F64x4, error: D::F64x4) -> Self {
        let one = simd.splat(1.0);
        let inverse = simd.div(one, denominator);
        let size = simd.abs(inverse);
        let relative_error = simd.mul(error, size);
        let twice = simd.add(relative_error, relative_error);
        Self {
            simd,
            inverse,
            relative_error: simd.add(twice, simd.splat(four_units::<f64>())),
            max_inverse: simd.mul_add(twice, size, size),
            is_certain: simd.cmp_ge(one, twice),
        }
    }

    /// Divides computed numerators with their errors by the denominators.
    #[inline(always)]
    pub(super) fn quotient(&self, numerator: D::F64x4, error: D::F64x4) -> Interval4<D> {
        let simd = self.simd;
        let quotient = simd.mul(numerator, self.inverse);
        let own = simd.mul(simd.abs(quotient), self.relative_error);
        let error = simd.mul_add(error, self.max_inverse, own);
        Interval4::new(simd, quotient, error)
    }
}
