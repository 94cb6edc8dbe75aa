//! The f64 filter of linear swept spheres, from the point of closest approach to the first end
//! ([`crate::geometry::closest_approach`]).
//!
//! # Test
//! With the closest approach w* in place of w, w*.d = 0, τ = t + σ* in place of t, and the parent
//! module's D, δ, g: let e = w*.D + r0 δ, m = D.d, q = m / d.d, k = g - m q and f = r0^2 - w*.w*.
//! Then
//!
//! ```text
//! u* g = e + m τ      H = e^2 + k f      τ = (e q - sqrt(g H / d.d)) / k      (the falling root)
//! ```
//!
//! # Error
//! With |w*| and r0 at most s, ρ = error_bound(s), c s <= ρ and R = sqrt(g H / d.d), for k >= D.D /
//! 16 and H >= 2 h, h = 8 (s + ρ) ρ D.D, t is off by at most
//!
//! ```text
//! E = (D.D / k) (ρ (14 / |d| + 8 (s + ρ) R / H) + 3 c |τ|),
//! ```
//!
//! u* g by 1.5 |D| |d| E, and H < -h is a miss. The derivation is in
//! `docs/derivations/linear-swept-sphere-filter.md`.

use super::{cap, side};
use crate::geometry::Intersection;
use crate::geometry::closest_approach::{self, ClosestApproach, ClosestApproachTerms};
use crate::geometry::object_ray::ObjectRay;
use crate::geometry::verdict::{Verdict, rounded};
use crate::math::real::{dot, from_f32, norm1, sub};

/// Where a ray enters the shape, if the error bound decides it. Shapes that are not solid or end in
/// an apex give a miss or are left undecided.
#[inline(always)]
pub(super) fn entry(
    ray: &ObjectRay,
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
    caps: [bool; 2],
) -> Verdict<Intersection> {
    let ClosestApproachTerms { inverse, inv_length, relative_error, .. } = ray.approach_terms;
    let approach = ClosestApproach::new(ray, positions[0]);
    let [r0, r1] = radii.map(f64::from);
    let axis = sub(from_f32(positions[1]), from_f32(positions[0]));
    let delta = r1 - r0;
    let size = norm1(approach.offset) + r0;
    let error_bound = approach.error_bound(ray, size);

    let square = dot(axis, axis);
    let g = square - delta * delta;
    let along = dot(axis, ray.direction);
    let lean = along * inverse;
    let k = g - along * lean;
    let begin = dot(approach.offset, axis) + r0 * delta;
    let room = r0 * r0 - dot(approach.offset, approach.offset);
    let h = begin * begin + k * room;
    let wide = 8.0 * (size + error_bound) * error_bound;
    let e_h = square * wide;
    // Written so that a NaN is undecided.
    if !(k >= square * (1.0 / 16.0) && r0 >= 0.0 && r1 >= 0.0) {
        return Verdict::Undecided;
    }
    if !(h >= e_h + e_h) {
        return if h < -e_h { Verdict::Miss } else { Verdict::Undecided };
    }
    let root = (g * h * inverse).sqrt();
    let inv_k = 1.0 / k;
    let tau = (begin * lean - root) * inv_k;
    let error = square
        * inv_k
        * (error_bound * (14.0 * inv_length) + wide * (root / h) + 3.0 * relative_error * tau.abs());

    let length = square.sqrt();
    let speed = 1.5 * length * ray.direction_norm;
    let place = begin + along * tau;
    let e_place = speed * error;
    let rest = g - place;
    let e_rest = e_place + relative_error * square;
    if place > e_place && rest > e_rest {
        let t = tau - approach.sigma;
        let t = match closest_approach::settle(ray, t, error) {
            Verdict::Hit(t) => t,
            Verdict::Miss => return Verdict::Miss,
            Verdict::Undecided => return Verdict::Undecided,
        };
        let inverse_g = 1.0 / g;
        let (u, e_u) = (place * inverse_g, 1.25 * inverse_g * e_rest);
        return match rounded(u - e_u, u + e_u) {
            Verdict::Hit(u) => Verdict::Hit(side(t, u)),
            _ => Verdict::Undecided,
        };
    }
    if place < -e_place {
        let (t, error) = match approach.entry(ray, r0, error_bound) {
            Verdict::Hit(entry) => entry,
            Verdict::Miss => return Verdict::Miss,
            Verdict::Undecided => return Verdict::Undecided,
        };
        let place = begin + along * (t + approach.sigma);
        let e_place = speed * (error + 2.0 * inv_length * error_bound);
        return if place < -e_place {
            on_cap(ray, (t, error), 0, caps)
        } else if place > e_place {
            Verdict::Miss
        } else {
            Verdict::Undecided
        };
    }
    if rest < -e_rest {
        let other = ClosestApproach::new(ray, positions[1]);
        let error_bound_1 = other.error_bound(ray, r1);
        let (t, error) = match other.entry(ray, r1, error_bound_1) {
            Verdict::Hit(entry) => entry,
            Verdict::Miss => return Verdict::Miss,
            Verdict::Undecided => return Verdict::Undecided,
        };
        let tau = t + approach.sigma;
        let rest = g - (begin + along * tau);
        let e_rest = speed * (error + 2.0 * inv_length * error_bound + relative_error * tau.abs())
            + relative_error * square;
        return if rest < -e_rest {
            on_cap(ray, (t, error), 1, caps)
        } else if rest > e_rest {
            Verdict::Miss
        } else {
            Verdict::Undecided
        };
    }
    Verdict::Undecided
}

#[inline(always)]
fn on_cap(ray: &ObjectRay, (t, error): (f64, f64), end: usize, caps: [bool; 2]) -> Verdict<Intersection> {
    if !caps[end] {
        return Verdict::Miss;
    }
    match closest_approach::settle(ray, t, error) {
        Verdict::Hit(t) => Verdict::Hit(cap(t, end)),
        Verdict::Miss => Verdict::Miss,
        Verdict::Undecided => Verdict::Undecided,
    }
}
