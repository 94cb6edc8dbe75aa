//! What the f64 step says of four primitives at once, and what it divides by.

use crate::geometry::{Intersection, Surface};
use crate::math::error_bound::four_units;
use crate::math::f32x4::F32x4;
use crate::math::f64x4::F64x4Ops;

/// A bit for every lane.
pub(super) const ALL: u32 = 0b1111;

/// Which of four primitives are hit and where, as far as f64 carries.
#[derive(Clone, Copy, Debug)]
pub struct Intersection4 {
    /// A bit for each that is hit, within the interval.
    pub(super) hits: u32,
    /// A bit for each of which the bounds can't tell.
    pub(super) undecided: u32,
    /// A bit for each that is met on the second surface.
    pub(super) marked: u32,
    /// Which they are met on.
    pub(super) surfaces: [Surface; 2],
    pub(super) t: [f32; 4],
    pub(super) attributes: [[f32; 4]; 2],
}

impl Intersection4 {
    /// All four are missed.
    pub const MISSED: Self = Self {
        hits: 0,
        undecided: 0,
        marked: 0,
        surfaces: [Surface::Sphere; 2],
        t: [0.0; 4],
        attributes: [[0.0; 4]; 2],
    };

    /// A bit for each primitive that is not surely missed.
    #[inline(always)]
    pub fn maybe_hit_mask(&self) -> u32 {
        self.hits | self.undecided
    }

    /// Where one of them is hit; `None` where that is undecided.
    #[inline(always)]
    pub fn hit(&self, lane: usize) -> Option<Intersection> {
        let [first, second] = &self.attributes;
        let lane = lane % 4;
        (self.hits >> lane & 1 != 0).then(|| Intersection {
            t: self.t[lane],
            attributes: [first[lane], second[lane]],
            surface: self.surfaces[(self.marked >> lane & 1) as usize],
        })
    }
}

/// Numbers, and between which the exact ones lie.
#[derive(Clone, Copy)]
pub(super) struct Ends<D: F64x4Ops> {
    pub middle: D::F64x4,
    pub below: D::F64x4,
    pub above: D::F64x4,
}

impl<D: F64x4Ops> Ends<D> {
    /// Computed numbers that are off by some errors at most.
    #[inline(always)]
    pub fn around(simd: D, middle: D::F64x4, error: D::F64x4) -> Self {
        Self { middle, below: simd.sub(middle, error), above: simd.add(middle, error) }
    }

    /// A bit for each lane where both ends round to one `f32`, and those: made of what lies between
    /// them, so that whoever takes them waits for no bound.
    #[inline(always)]
    pub fn rounded(&self, simd: D) -> (u32, F32x4) {
        let [first, last] = self.rounded_ends(simd);
        (first.cmp_ge(last), self.rounded_middle(simd))
    }

    /// Both ends, rounded; of `f32`, those above them or below are of what lies between them, too.
    #[inline(always)]
    pub fn rounded_ends(&self, simd: D) -> [F32x4; 2] {
        [self.below, self.above].map(|end| F32x4::new(simd.to_f32(end)))
    }

    /// What lies between the ends, rounded, with no sign where it is 0.
    #[inline(always)]
    pub fn rounded_middle(&self, simd: D) -> F32x4 {
        F32x4::new(simd.to_f32(self.middle)) + F32x4::ZERO
    }
}

/// `math::error_bound::Divisor` in four lanes.
#[derive(Clone, Copy)]
pub(super) struct Divisor4<D: F64x4Ops> {
    simd: D,
    inverse: D::F64x4,
    /// Twice its own relative error, and the roundings of a quotient.
    relative: D::F64x4,
    most: D::F64x4,
    /// A bit for each lane in which the others mean something.
    pub is_certain: u32,
}

impl<D: F64x4Ops> Divisor4<D> {
    /// Denominators that are off by some errors at most.
    #[inline(always)]
    pub fn new(simd: D, denominator: D::F64x4, error: D::F64x4) -> Self {
        let one = simd.splat(1.0);
        let inverse = simd.div(one, denominator);
        let size = simd.abs(inverse);
        let relative = simd.mul(error, size);
        let twice = simd.add(relative, relative);
        Self {
            simd,
            inverse,
            relative: simd.add(twice, simd.splat(four_units::<f64>())),
            most: simd.mul_add(twice, size, size),
            is_certain: simd.cmp_ge(one, twice),
        }
    }

    /// Numerators over them.
    #[inline(always)]
    pub fn quotient(&self, numerator: D::F64x4, error: D::F64x4) -> Ends<D> {
        let simd = self.simd;
        let quotient = simd.mul(numerator, self.inverse);
        let own = simd.mul(simd.abs(quotient), self.relative);
        let error = simd.mul_add(error, self.most, own);
        Ends::around(simd, quotient, error)
    }
}
