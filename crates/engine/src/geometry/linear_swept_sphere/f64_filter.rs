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
use crate::geometry::approach_terms::ClosestApproachTerms;
use crate::geometry::closest_approach::{self, ClosestApproach};
use crate::geometry::object_ray::ObjectRay;
use crate::geometry::verdict::{Verdict, rounded};
use crate::math::array;
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
    let [r0, r1] = array::map(radii, f64::from);
    let axis = sub(from_f32(positions[1]), from_f32(positions[0]));
    let delta = r1 - r0;
    let size = norm1(approach.offset) + r0;
    let error_bound = approach.error_bound(ray, size);

    let axis2 = dot(axis, axis);
    let g = axis2 - delta * delta;
    let m = dot(axis, ray.direction);
    let q = m * inverse;
    let k = g - m * q;
    let e = dot(approach.offset, axis) + r0 * delta;
    let f = r0 * r0 - dot(approach.offset, approach.offset);
    let h = e * e + k * f;
    let h_error_factor = 8.0 * (size + error_bound) * error_bound;
    let e_h = axis2 * h_error_factor;
    // Written so that a NaN is undecided.
    if !(k >= axis2 * (1.0 / 16.0) && r0 >= 0.0 && r1 >= 0.0) {
        return Verdict::Undecided;
    }
    if !(h >= e_h + e_h) {
        return if h < -e_h { Verdict::Miss } else { Verdict::Undecided };
    }
    let root = (g * h * inverse).sqrt();
    let inv_k = 1.0 / k;
    let tau = (e * q - root) * inv_k;
    let error = axis2
        * inv_k
        * (error_bound * (14.0 * inv_length)
            + h_error_factor * (root / h)
            + 3.0 * relative_error * tau.abs());

    let length = axis2.sqrt();
    // v is u* g.
    let v_error_factor = 1.5 * length * ray.direction_norm;
    let v = e + m * tau;
    let e_v = v_error_factor * error;
    let g_minus_v = g - v;
    let e_g_minus_v = e_v + relative_error * axis2;
    if v > e_v && g_minus_v > e_g_minus_v {
        let t = tau - approach.sigma;
        let t = match closest_approach::round_within(ray, t, error) {
            Verdict::Hit(t) => t,
            Verdict::Miss => return Verdict::Miss,
            Verdict::Undecided => return Verdict::Undecided,
        };
        let inverse_g = 1.0 / g;
        let (u, e_u) = (v * inverse_g, 1.25 * inverse_g * e_g_minus_v);
        return match rounded(u - e_u, u + e_u) {
            Verdict::Hit(u) => Verdict::Hit(side(t, u)),
            _ => Verdict::Undecided,
        };
    }
    if v < -e_v {
        let (t, error) = match approach.entry(ray, r0, error_bound) {
            Verdict::Hit(entry) => entry,
            Verdict::Miss => return Verdict::Miss,
            Verdict::Undecided => return Verdict::Undecided,
        };
        let v = e + m * (t + approach.sigma);
        let e_v = v_error_factor * (error + 2.0 * inv_length * error_bound);
        return if v < -e_v {
            on_cap(ray, t, error, 0, caps)
        } else if v > e_v {
            Verdict::Miss
        } else {
            Verdict::Undecided
        };
    }
    if g_minus_v < -e_g_minus_v {
        let other = ClosestApproach::new(ray, positions[1]);
        let error_bound_1 = other.error_bound(ray, r1);
        let (t, error) = match other.entry(ray, r1, error_bound_1) {
            Verdict::Hit(entry) => entry,
            Verdict::Miss => return Verdict::Miss,
            Verdict::Undecided => return Verdict::Undecided,
        };
        let tau = t + approach.sigma;
        let g_minus_v = g - (e + m * tau);
        let e_g_minus_v = v_error_factor
            * (error + 2.0 * inv_length * error_bound + relative_error * tau.abs())
            + relative_error * axis2;
        return if g_minus_v < -e_g_minus_v {
            on_cap(ray, t, error, 1, caps)
        } else if g_minus_v > e_g_minus_v {
            Verdict::Miss
        } else {
            Verdict::Undecided
        };
    }
    Verdict::Undecided
}

#[inline(always)]
fn on_cap(ray: &ObjectRay, t: f64, error: f64, end: usize, caps: [bool; 2]) -> Verdict<Intersection> {
    if !caps[end] {
        return Verdict::Miss;
    }
    match closest_approach::round_within(ray, t, error) {
        Verdict::Hit(t) => Verdict::Hit(cap(t, end)),
        Verdict::Miss => Verdict::Miss,
        Verdict::Undecided => Verdict::Undecided,
    }
}
