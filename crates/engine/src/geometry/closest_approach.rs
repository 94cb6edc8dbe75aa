//! The point of closest approach of a ray's line to a centre, from which rays are tested against
//! spheres and linear swept spheres in few operations, with an error bound (Higham, *Accuracy and
//! Stability of Numerical Algorithms*).
//!
//! # Derivation
//! With w = origin - centre, σ* = w.d / d.d and w* = w - σ* d the line is w* + τ d, τ = t + σ*,
//! with w*.d = 0 (E. Haines, J. Günther and T. Akenine-Möller, *Precision improvements for
//! ray/sphere intersection*, Ray Tracing Gems, 2019). Formulas in w* cancel no more than |w*| and
//! the radius allow; the distance |w| enters only in the error of w* itself.
//!
//! # Error
//! u = 2^-53; oe bounds the origin's error, κ the direction's relative one (1-norms; in the 2-norm,
//! |.| from here on, it is κ2 = √3 κ). Let w, b = w.d, dd, its inverse, σ = b / dd and l = w - σ d
//! be computed, each operation rounded once (Higham, sections 2.2 and 3.1). To first order
//!
//! ```text
//! w      u |w| + oe                 b      |d| ((4 u + κ2) |w| + oe)
//! 1/dd   relatively 4 u + 2 κ2      σ      ((9 u + 3 κ2) |w| + oe) / |d|
//! l      (12 u + 4 κ2) |w| + 2 oe, which also bounds |d| times the error of σ
//! ```
//!
//! and as |w| <= |w*| + |σ*| |d|, with the 1-norm n >= |d| and any s >= |l|,
//!
//! ```text
//! error_bound(s) = a + c (s + n |σ|)      c = 16 u + 8 κ      a = 9/4 oe + 2^-100
//! ```
//!
//! bounds both |l - w*| and |d| |σ - σ*|: 16 and 8 outweigh 12 and 4 √3 by a seventh, 9/4 the 2 by
//! an eighth, and what is of second order, or lost in evaluating it, is less than a thirtieth for κ
//! <= 2^-10. Also u s <= error_bound(s) / 16. Where n is not within 2^-64 and 2^64, or `ObjectRay`
//! bounds nothing, c is infinite, so that nothing is decided; 2^-100 outweighs every underflow.
//!
//! # Spheres
//! A sphere of radius r about the centre is entered at t = -(σ* + sqrt((r^2 - w*.w*) / d.d)). With
//! ρ = error_bound(r) and |l| <= r the computed squared half chord r^2 - l.l is off by at most (7/3
//! r + ρ) ρ; it has to be at least (r / 8 + 16 ρ)^2, so that it is off by less than 19 ρ times its
//! own root. That root is then off by at most 11.5 ρ, the half chord by as much over |d|, with ρ /
//! 4 for the inverse and the rounding of the root, and t, with σ's ρ / |d| and the last rounding,
//! by less than 16 ρ / |d|. (Rays that graze the sphere, with less than a 64th of r^2 left, stay
//! undecided.) The line passes by where |l| > r + error_bound(|l|), that is |l| (1 - c) > r + ρ.

use crate::geometry::approach_terms::ClosestApproachTerms;
use crate::geometry::object_ray::ObjectRay;
use crate::geometry::verdict::{Verdict, rounded};
use crate::math::real::{dot, from_f32, scale, sub};

/// Decides whether a t with an error of at most `error` is in the interval, and rounds it.
#[inline(always)]
pub(super) fn round_within(ray: &ObjectRay, t: f64, error: f64) -> Verdict<f32> {
    let (t_min, t_max) = ray.approach_terms.interval;
    let (below, above) = (t - error, t + error);
    if below >= t_min && above <= t_max {
        return rounded(below, above);
    }
    if above < t_min || below > t_max { Verdict::Miss } else { Verdict::Undecided }
}

/// The computed point of closest approach.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClosestApproach {
    /// The vector from the centre to the point: l above.
    pub offset: [f64; 3],
    /// The negated t of the point: σ above.
    pub sigma: f64,
    /// n |σ|, a bound of the distance from the origin.
    pub travel: f64,
}

impl ClosestApproach {
    /// Computes the point that is closest to a centre.
    #[inline(always)]
    pub(super) fn new(ray: &ObjectRay, center: [f32; 3]) -> Self {
        let w = sub(ray.origin, from_f32(center));
        let sigma = dot(ray.direction, w) * ray.approach_terms.inverse;
        Self { offset: sub(w, scale(sigma, ray.direction)), sigma, travel: sigma.abs() * ray.direction_norm }
    }

    /// A bound of the error of `offset` and of `sigma` times |d|; `size` is at least the length of
    /// the offset.
    #[inline(always)]
    pub(super) fn error_bound(&self, ray: &ObjectRay, size: f64) -> f64 {
        ray.approach_terms.absolute_error + ray.approach_terms.relative_error * (size + self.travel)
    }

    /// The t at which the line enters a sphere about the centre, and a bound of its error.
    /// `error_bound` is that of the radius or of more. A sphere whose radius is not positive is not
    /// entered.
    #[inline(always)]
    pub(super) fn entry(&self, ray: &ObjectRay, radius: f64, error_bound: f64) -> Verdict<(f64, f64)> {
        let ClosestApproachTerms { inverse, inv_length, relative_error, .. } = ray.approach_terms;
        let square = dot(self.offset, self.offset);
        let half_chord2 = radius * radius - square;
        let threshold = 0.125 * radius + 16.0 * error_bound;
        if half_chord2 >= threshold * threshold && radius > 0.0 {
            let half_chord = (half_chord2 * inverse).sqrt();
            return Verdict::Hit((-self.sigma - half_chord, 16.0 * inv_length * error_bound));
        }
        let outer = radius + error_bound;
        if square * (1.0 - 3.0 * relative_error) > outer * outer { Verdict::Miss } else { Verdict::Undecided }
    }
}
