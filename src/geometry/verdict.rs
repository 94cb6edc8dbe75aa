//! What a bounded attempt can say, and how its last step is taken.

use crate::geometry::object_ray::View;
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
    /// The answer of an attempt without bounds, which leaves nothing undecided.
    #[inline(always)]
    pub(super) fn found(self) -> Option<T> {
        match self {
            Self::Hit(found) => Some(found),
            Self::Miss | Self::Undecided => None,
        }
    }
}

/// An error bound, or 0 in an attempt without bounds (all that it was made from falls away then).
#[inline(always)]
pub(super) fn when<R: Real, const BOUNDED: bool>(error: R) -> R {
    if BOUNDED { error } else { R::ZERO }
}

/// Tests a parameter against the closed interval and rounds it.
#[inline(always)]
pub(super) fn settle_closed<R: Real, const BOUNDED: bool>(ray: &View<R>, t: R, error: R) -> Verdict<f32> {
    if !BOUNDED && !is_finite(t) {
        return Verdict::Miss;
    }
    let error = when::<R, BOUNDED>(error);
    let (below, above) = (t - error, t + error);
    if above < ray.t_min || below > ray.t_max {
        return Verdict::Miss;
    }
    if below >= ray.t_min && above <= ray.t_max {
        return representable(rounded(below, above));
    }
    if BOUNDED { Verdict::Undecided } else { Verdict::Miss }
}

/// A t that rounds to infinity is none that a shader could be told: no hit.
#[inline(always)]
pub(super) fn representable(t: Verdict<f32>) -> Verdict<f32> {
    match t {
        Verdict::Hit(t) if !t.is_finite() => Verdict::Miss,
        other => other,
    }
}

/// The one `f32` to which all of an interval rounds; undecided where there are two.
#[inline(always)]
pub(super) fn rounded<R: Real>(below: R, above: R) -> Verdict<f32> {
    let nearest = below.to_f32();
    if nearest == above.to_f32() { Verdict::Hit(nearest + 0.0) } else { Verdict::Undecided }
}

/// Whether a parameter without a bound means anything.
#[inline(always)]
fn is_finite<R: Real>(t: R) -> bool {
    t.abs() < R::ONE / R::ZERO
}
