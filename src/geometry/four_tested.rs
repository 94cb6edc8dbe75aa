//! What the f64 step says of four primitives at once.

use crate::geometry::{Intersection, Surface};
use crate::math::doubles::Doubles;
use crate::math::four::Four;

/// A bit for every lane.
pub(super) const ALL: u32 = 0b1111;

/// Which of four primitives are hit and where, as far as f64 carries.
#[derive(Clone, Copy, Debug)]
pub struct FourTested {
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

impl FourTested {
    /// All are missed.
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
    pub fn met(&self) -> u32 {
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

/// Between which numbers the exact ones lie.
#[derive(Clone, Copy)]
pub(super) struct Ends<D: Doubles> {
    pub below: D::Four,
    pub above: D::Four,
}

impl<D: Doubles> Ends<D> {
    /// A bit for each lane where both ends round to one `f32`, and those.
    #[inline(always)]
    pub fn rounded(&self, doubles: D) -> (u32, Four) {
        let first = Four::new(doubles.to_floats(self.below));
        let last = Four::new(doubles.to_floats(self.above));
        (first.at_least(last) & last.at_least(first), first + Four::ZERO)
    }
}
