//! A ray with bounds of its errors, in the format that a filter calculates in.

use crate::math::real::Real;

/// The ray in the format R with error bounds, as a filter reads it.
///
/// Its two errors are made so that short formulas hold. With κ the direction's relative error
/// (1-norm, at most 2^-10) `relative_error` is c = κ + 12u, and for a point p known exactly, w =
/// origin - p computed with one rounding, ρ = `error_bound(|w|)` is `origin_error` + c |w|. Then,
/// |.| the 1-norm and v a difference of two given vectors (one rounding), up to the slack that
/// `math::error_bound` asks for:
///
/// ```text
/// d x v           c |d| |v|            rounding 2u, v 1u, d κ; second order κ u
/// d . v           c |d| |v|            3u, 1u, κ
/// d x w           |d| ρ                2u, w 1u + origin, d κ; second order κ origin <= origin / 1024
/// d . w           |d| ρ                3u, 1u + origin, κ
/// w x v, w . v    |v| ρ                at most 3u, 1u + origin, 1u
/// w . (d x v)     |d| |v| ρ            3u, 1u + origin, 3u + κ of d x v
/// v . (d x v')    c |d| |v| |v'|       3u, 1u, 3u + κ
/// d . (w x v)     |d| |v| ρ            3u, κ, 4u + origin of w x v
/// v . (w x v')    |v| |v'| ρ           3u, 1u, 4u + origin
/// ```
///
/// each at most 9u of its rounding share, where c has 12u.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoundedRay<R> {
    pub origin: [R; 3],
    pub direction: [R; 3],
    /// A bound of the 1-norm of the origin's error.
    pub origin_error: R,
    /// The relative error c above.
    pub relative_error: R,
    /// The 1-norm of the direction.
    pub direction_norm: R,
    pub t_min: R,
    pub t_max: R,
}

impl<R: Real> BoundedRay<R> {
    /// The bound that stands for |w| in the error of a product with w = origin - p.
    #[inline(always)]
    pub(super) fn error_bound(&self, norm: R) -> R {
        self.origin_error + self.relative_error * norm
    }
}
