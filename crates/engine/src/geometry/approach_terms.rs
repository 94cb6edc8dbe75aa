//! What a ray keeps for its closest approaches. `closest_approach` derives the error bounds and
//! names their terms a and c.

use crate::math::real::dot;

/// The terms of a ray that closest approaches need.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClosestApproachTerms {
    /// 1 / d.d, the inverse of the squared length of the direction.
    pub inverse: f64,
    /// An upper bound of 1 / |d|, at most √3 / |d|.
    pub inv_length: f64,
    /// c, the part of the error that grows with the distances.
    pub relative_error: f64,
    /// a, the part of the error that does not.
    pub absolute_error: f64,
    /// The interval of the ray without the t that round to infinity, which are no hits.
    pub interval: (f64, f64),
}

impl ClosestApproachTerms {
    /// Placeholder value.
    pub(super) const EMPTY: Self = Self {
        inverse: 0.0,
        inv_length: 0.0,
        relative_error: f64::INFINITY,
        absolute_error: f64::INFINITY,
        interval: (0.0, 0.0),
    };

    /// The least and the greatest n that bounds are known for: 2^-64 and 2^64.
    pub(super) const RANGE: (f64, f64) = (1.0 / 18_446_744_073_709_551_616.0, 18_446_744_073_709_551_616.0);

    /// Makes the terms from a direction with its 1-norm, the error bounds of `ObjectRay` and the
    /// interval. The caller [disables](Self::disable) them if the norm is outside of
    /// [`Self::RANGE`].
    #[inline(always)]
    pub(super) fn new(
        direction: [f64; 3],
        norm: f64,
        origin_error_norm: f64,
        direction_relative_error: f64,
        t_min: f32,
        t_max: f32,
    ) -> Self {
        let inverse = 1.0 / dot(direction, direction);
        Self {
            inverse,
            inv_length: norm * inverse,
            relative_error: 8.0 * f64::EPSILON + 8.0 * direction_relative_error,
            absolute_error: 2.25 * origin_error_norm + TINY,
            interval: (t_min.into(), f64::from(t_max).min(MAX_T)),
        }
    }

    /// Makes the error bounds infinite, so that nothing is decided.
    pub(super) fn disable(&mut self) {
        (self.relative_error, self.absolute_error) = (f64::INFINITY, f64::INFINITY);
    }
}

/// Just below the middle of the greatest f32 and 2^128, from which on numbers round to infinity.
const MAX_T: f64 = (f32::MAX as f64 + (1u128 << 103) as f64).next_down();

/// 2^-100, which outweighs underflow.
const TINY: f64 = 1.0 / ((1u128 << 100) as f64);
