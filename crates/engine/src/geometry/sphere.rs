//! Spheres.
//!
//! # Derivation
//! With m the vector from the centre to the origin, the ray meets the sphere where
//! A t^2 + 2 B t + C = 0, A = d.d, B = d.m, C = m.m - r^2. Its reduced discriminant is
//!
//! ```text
//! B^2 - A C = r^2 d.d - |d x m|^2        (Lagrange's identity)
//! ```
//!
//! The right side is what is evaluated: B^2 and A C agree in all digits that the distance takes,
//! r^2 d.d and |d x m|^2 only in those that the ray's closeness to the silhouette takes (the error
//! relative to r^2 d.d is of order u |m| / r instead of u |m|^2 / r^2). The *entry* is the root
//! with the minus sign.
//!
//! **First** a filter starts from the closest approach to the centre
//! (`geometry::closest_approach`), one square root and no division, with a bound that is nearly
//! free; it leaves undecided rays that graze the sphere or start very near, and a t within some
//! units of 2^-45 of the middle between two f32.
//!
//! **Then** with a running bound: with s = sqrt(discriminant) the entry, written without
//! cancellation, is
//!
//! ```text
//! t = C / (s - B)  where B <= 0        t = -(B + s) / A  where B > 0.
//! ```
//!
//! Only the entry counts (SEMANTICS 2.5): for an origin inside it is negative and therefore out of
//! the interval, as t_min >= 0. A tangent, discriminant 0, is a hit.
//!
//! # Error of the running bound
//! Norms are 1-norms, which bound the length from above. d x m and d.m have the bounds of the table
//! at `object_ray::BoundedRay`, d.d that of d.v with κ twice; a product of two such values has
//! `math::error_bound::product_error`, a quotient `Divisor`; sqrt(x) for x > e is off by at most (e
//! / x + u) sqrt(x). Nothing over- or underflows for f32-sized centres and radii and the rays that
//! `ObjectRay` lets into f64: the greatest product is r^2 d.d <= 2^516, the least r^2 d.d >=
//! 2^-598.

mod four;

use crate::geometry::bounded_ray::BoundedRay;
use crate::geometry::closest_approach::{self, ClosestApproach};
use crate::geometry::object_ray::ObjectRay;
use crate::geometry::verdict::{Verdict, error_or_zero, round_within_closed};
use crate::geometry::{Bounds, Intersection, Precision, Surface};
use crate::math::error_bound::{Divisor, product_error, two_units};
use crate::math::exact::{self, Dyadic, Vector};
use crate::math::real::{Real, cross, dot, from_f32, norm1, sub};
use crate::math::surd::Surd;

pub(super) use four::intersect4;

/// Where a ray enters a sphere, within the closed interval. A sphere without a positive, finite
/// radius and a finite centre is never hit.
#[inline(always)]
pub fn intersect(
    ray: &ObjectRay,
    center: [f32; 3],
    radius: f32,
    precision: Precision,
) -> Option<Intersection> {
    let t = match precision {
        Precision::Exact => match f64_filter(ray, center, radius) {
            Verdict::Hit(t) => t,
            Verdict::Miss => return None,
            Verdict::Undecided => intersect_with_running_bound(ray, center, radius)?,
        },
        Precision::Float => intersect_in::<f32>(ray, center, radius)?,
        Precision::Double => intersect_in::<f64>(ray, center, radius)?,
    };
    Some(Intersection { t, attributes: [0.0; 2], surface: Surface::Sphere })
}

/// The test without bounds.
#[inline(always)]
fn intersect_in<R: Real>(ray: &ObjectRay, center: [f32; 3], radius: f32) -> Option<f32> {
    if is_solid(center, radius) { filtered::<R, false>(ray, center, radius).into_hit() } else { None }
}

/// The test of rays that the filter leaves undecided.
#[cold]
#[inline(never)]
fn intersect_with_running_bound(ray: &ObjectRay, center: [f32; 3], radius: f32) -> Option<f32> {
    if !is_solid(center, radius) {
        return None;
    }
    match filtered::<f64, true>(ray, center, radius) {
        Verdict::Hit(t) => Some(t),
        Verdict::Miss => None,
        Verdict::Undecided => intersect_exactly(ray, center, radius),
    }
}

/// Whether f64 decides this test, so that exact arithmetic is not needed: for statistics.
pub fn is_decided_in_f64(ray: &ObjectRay, center: [f32; 3], radius: f32) -> bool {
    !is_solid(center, radius)
        || f64_filter(ray, center, radius) != Verdict::Undecided
        || filtered::<f64, true>(ray, center, radius) != Verdict::Undecided
}

/// The box around a sphere; `None` where it is never hit.
#[inline]
pub fn bounds(center: [f32; 3], radius: f32) -> Option<Bounds> {
    is_solid(center, radius).then(|| Bounds::around(center, radius))
}

fn is_solid(center: [f32; 3], radius: f32) -> bool {
    radius > 0.0 && radius.is_finite() && center.iter().all(|x| x.is_finite())
}

/// The f64 filter, from the point of closest approach. A sphere that is not solid is never hit.
#[inline(always)]
fn f64_filter(ray: &ObjectRay, center: [f32; 3], radius: f32) -> Verdict<f32> {
    let approach = ClosestApproach::new(ray, center);
    let radius = f64::from(radius);
    let error_bound = approach.error_bound(ray, radius);
    match approach.entry(ray, radius, error_bound) {
        Verdict::Hit((t, error)) => closest_approach::round_within(ray, t, error),
        Verdict::Miss => Verdict::Miss,
        Verdict::Undecided => Verdict::Undecided,
    }
}

#[inline(always)]
fn filtered<R: Real, const BOUNDED: bool>(ray: &ObjectRay, center: [f32; 3], radius: f32) -> Verdict<f32> {
    let view = ray.bounded::<R>();
    match entry::<R, BOUNDED>(&view, from_f32(center), R::from_f32(radius)) {
        Verdict::Hit((t, error)) => round_within_closed::<R, BOUNDED>(&view, t, error),
        Verdict::Miss => Verdict::Miss,
        Verdict::Undecided => Verdict::Undecided,
    }
}

/// The parameter at which the whole line enters a sphere, and its error; a miss where the line
/// passes by.
#[inline(always)]
pub(super) fn entry<R: Real, const BOUNDED: bool>(
    ray: &BoundedRay<R>,
    center: [R; 3],
    radius: R,
) -> Verdict<(R, R)> {
    let u2 = two_units::<R>();
    let (d, dn) = (ray.direction, ray.direction_norm);
    let m = sub(ray.origin, center);
    let mn = norm1(m);

    let dd = dot(d, d);
    let e_dd = (ray.relative_error + ray.relative_error) * (dn * dn);
    let q = cross(d, m);
    let e_dm = dn * ray.error_bound(mn);
    let qn = norm1(q);
    let qq = dot(q, q);
    let rr = radius * radius;
    let span = rr * dd;
    let discriminant = span - qq;
    let e_discriminant =
        error_or_zero::<R, BOUNDED>(rr * e_dd + product_error(qn, e_dm, qn, e_dm) + u2 * (span + span + qq));
    if discriminant < -e_discriminant {
        return Verdict::Miss;
    }
    if BOUNDED && !(discriminant > e_discriminant) {
        return Verdict::Undecided;
    }
    let s = discriminant.sqrt();
    let e_s = s * (e_discriminant / discriminant + u2);

    let b = dot(d, m);
    let (numerator, e_numerator, denominator, e_denominator) = if b <= R::ZERO {
        let mm = dot(m, m);
        let em = ray.origin_error + u2 * mn;
        let den = s - b;
        (mm - rr, product_error(mn, em, mn, em) + u2 * (mm + rr), den, e_s + e_dm + u2 * den)
    } else {
        let num = -(b + s);
        (num, e_s + e_dm - u2 * num, dd, e_dd)
    };
    if !BOUNDED {
        return Verdict::Hit((numerator / denominator, R::ZERO));
    }
    Verdict::Hit(Divisor::new(denominator, e_denominator).quotient(numerator, e_numerator))
}

#[cold]
#[inline(never)]
fn intersect_exactly(ray: &ObjectRay, center: [f32; 3], radius: f32) -> Option<f32> {
    let exact = ray.exact();
    let m = exact.origin_from(&exact::vector(center));
    let radius = &exact.weight * &Dyadic::from_f32(radius);
    ray.round_within_closed(&entry_exactly(&m, &exact.direction, &radius)?)
}

/// The parameter at which the line `m + t d` enters the sphere of a radius around 0; `None` where
/// it passes by (or has no direction).
pub(super) fn entry_exactly(m: &Vector, d: &Vector, radius: &Dyadic) -> Option<Surd> {
    let a = exact::dot(d, d);
    let b = exact::dot(d, m);
    let c = &exact::dot(m, m) - &radius.square();
    let discriminant = &b.square() - &(&a * &c);
    if a.is_zero() || discriminant.sign() < 0 {
        return None;
    }
    Some(Surd::new(-&b, Dyadic::integer(-1), discriminant, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;

    fn hit(ray: Ray, center: [f32; 3], radius: f32) -> Option<f32> {
        let ray = ObjectRay::new(&ray, None).unwrap();
        intersect(&ray, center, radius, Precision::Exact).map(|hit| hit.t)
    }

    #[test]
    fn only_the_entry_counts() {
        let ray = Ray::new([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        assert_eq!(hit(ray, [0.0; 3], 1.0), Some(2.0));
        assert_eq!(hit(ray.with_interval(2.0, 2.0), [0.0; 3], 1.0), Some(2.0));
        assert_eq!(hit(ray.with_interval(2.0f32.next_up(), 9.0), [0.0; 3], 1.0), None);
        assert_eq!(hit(ray.with_interval(0.0, 2.0f32.next_down()), [0.0; 3], 1.0), None);
        assert_eq!(hit(Ray::new([0.5, 0.0, 0.0], [1.0, 0.0, 0.0]), [0.0; 3], 1.0), None);
        // From the surface: inwards the entry is at 0, outwards it lies behind.
        assert_eq!(hit(Ray::new([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]), [0.0; 3], 1.0), Some(0.0));
        assert_eq!(hit(Ray::new([1.0, 0.0, 0.0], [1.0, 0.0, 0.0]), [0.0; 3], 1.0), None);
    }

    #[test]
    fn a_tangent_is_a_hit_and_its_neighbour_is_not() {
        // (3, 4, 12)/13 is a unit vector: a tangent at its 13-fold to a sphere of radius 13.
        let touch = |x: f32| hit(Ray::new([x + 4.0, 4.0 - 3.0, 12.0], [-4.0, 3.0, 0.0]), [0.0; 3], 13.0);
        assert_eq!(touch(3.0), Some(1.0));
        assert_eq!(touch(3.0 + 1e-6), None);
        for k in [-100, -60, 60] {
            let s = 2f32.powi(k);
            let ray = Ray::new([7.0 * s, s, 12.0 * s], [-4.0 * s, 3.0 * s, 0.0]);
            assert_eq!(hit(ray, [0.0; 3], 13.0 * s), Some(1.0));
            assert_eq!(hit(ray, [0.0; 3], (13.0 * s).next_down()), None);
        }
    }

    #[test]
    fn what_is_no_sphere_is_never_hit() {
        let ray = Ray::new([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        for radius in [0.0, -0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(hit(ray, [0.0; 3], radius), None);
            assert_eq!(bounds([0.0; 3], radius), None);
        }
        assert_eq!(hit(ray, [f32::NAN, 0.0, 0.0], 1.0), None);
        assert_eq!(hit(Ray::new([-3.0, 0.0, 0.0], [0.0; 3]), [0.0; 3], 1.0), None);
    }
}
