//! The verdict of a filter, and the test of its t against the interval.

use crate::geometry::bounded_ray::BoundedRay;
use crate::math::real::Real;

/// The outcome of a filter: a floating-point test with an error bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict<T> {
    /// The ray certainly misses.
    Miss,
    /// The result is certain.
    Hit(T),
    /// The error bound does not decide: exact arithmetic must.
    Undecided,
}

impl<T> Verdict<T> {
    /// The result of a test without error bounds, which leaves nothing undecided.
    #[inline(always)]
    pub(super) fn into_hit(self) -> Option<T> {
        match self {
            Self::Hit(found) => Some(found),
            Self::Miss | Self::Undecided => None,
        }
    }
}

/// An error bound, or 0 in a test without bounds, which the compiler then does not compute.
#[inline(always)]
pub(super) fn error_or_zero<R: Real, const BOUNDED: bool>(error: R) -> R {
    if BOUNDED { error } else { R::ZERO }
}

/// Tests a parameter against the closed interval and rounds it.
#[inline(always)]
pub(super) fn round_within_closed<R: Real, const BOUNDED: bool>(
    ray: &BoundedRay<R>,
    t: R,
    error: R,
) -> Verdict<f32> {
    if !BOUNDED && !is_finite(t) {
        return Verdict::Miss;
    }
    let error = error_or_zero::<R, BOUNDED>(error);
    let (below, above) = (t - error, t + error);
    if above < ray.t_min || below > ray.t_max {
        return Verdict::Miss;
    }
    if below >= ray.t_min && above <= ray.t_max {
        return representable(rounded(below, above));
    }
    if BOUNDED { Verdict::Undecided } else { Verdict::Miss }
}

/// Turns a hit whose t rounds to infinity into a miss, as no shader could read such a t.
#[inline(always)]
pub(super) fn representable(t: Verdict<f32>) -> Verdict<f32> {
    match t {
        Verdict::Hit(t) if !t.is_finite() => Verdict::Miss,
        other => other,
    }
}

/// The `f32` to which the whole interval rounds; undecided if its ends round to different ones.
#[inline(always)]
pub(super) fn rounded<R: Real>(below: R, above: R) -> Verdict<f32> {
    let nearest = below.to_f32();
    if nearest == above.to_f32() { Verdict::Hit(nearest + 0.0) } else { Verdict::Undecided }
}

/// Whether a parameter is finite.
#[inline(always)]
fn is_finite<R: Real>(t: R) -> bool {
    t.abs() < R::ONE / R::ZERO
}
