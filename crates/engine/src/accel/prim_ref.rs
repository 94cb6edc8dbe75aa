//! A reference to a primitive while a tree is built: its box and its number.

use crate::geometry::Bounds;
use crate::math::f32x4::F32x4;

/// A reference to a primitive: its number and its box. It is stored as the minimum corner, the
/// number and the negated maximum corner, so that one eight-lane minimum makes the union of two
/// boxes.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct PrimRef(pub [f32; 8]);

const INF: f32 = f32::INFINITY;

/// The coordinate that stands for infinity: finite coordinates lie in the unit cube.
pub(super) const INFINITY_PROXY: f32 = 2.0;

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
    pub(super) fn center2(&self) -> F32x4 {
        self.low() - self.negated_high()
    }

    /// Twice the centroid on one axis.
    #[inline(always)]
    pub(super) fn center2_on(&self, axis: usize) -> f32 {
        self.0[axis] - self.0[axis + 4]
    }
}

/// Decodes the corners of a [`PrimRef`].
#[inline(always)]
pub(super) fn bounds_of(&[a, b, c, _, d, e, f, _]: &[f32; 8]) -> Bounds {
    Bounds { min: [a, b, c], max: [-d, -e, -f] }
}

/// Half the surface area of a box whose corners are stored as in a [`PrimRef`]. It only ranks
/// splits.
#[inline(always)]
pub(super) fn half_area(&[a, b, c, _, d, e, f, _]: &[f32; 8]) -> f32 {
    // The extents, negated.
    let (x, y, z) = (a + d, b + e, c + f);
    x * y + y * z + z * x
}
