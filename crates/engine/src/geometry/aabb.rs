//! Axis-parallel boxes.
//!
//! # Derivation
//! The line is within the slab of axis i for t in [n_i, f_i], n_i = (near side - o_i) / d_i and f_i
//! = (far side - o_i) / d_i; it is within the box for t from the greatest n_i to the least f_i
//! (slabs: Kay and Kajiya 1986). The box is a candidate where that meets the closed interval:
//! max(t_min, n_i) <= min(t_max, f_i). The reported t is max(t_min, n_i): the entry, or t_min for a
//! start inside. An axis without direction has no n and f; its origin must lie in the closed slab.
//! An infinite side does not confine.
//!
//! n_i <= f_i of one axis needs no arithmetic (min <= max), so that flat boxes don't need the exact
//! step.
//!
//! Vulkan allows false positives (SEMANTICS 4.2); none are given here. A box with a NaN or min >
//! max holds nothing and is never hit (a NaN in min.x makes it inactive by SEMANTICS 2.6).
//!
//! # Error
//! A difference costs one rounding and the origin's error, the quotient's bound is
//! `math::error_bound::quotient_error`.

use std::cmp::Ordering;

use crate::geometry::object_ray::ObjectRay;
use crate::geometry::verdict::{Verdict, error_or_zero, representable, rounded};
use crate::geometry::{Bounds, Intersection, Precision, Surface};
use crate::math::error_bound::{quotient_error, two_units};
use crate::math::exact::Dyadic;
use crate::math::real::Real;
use crate::math::surd::Surd;

/// Where a ray enters a box, or t_min for a start inside, within the closed interval.
#[inline]
pub fn intersect(
    ray: &ObjectRay,
    min: [f32; 3],
    max: [f32; 3],
    precision: Precision,
) -> Option<Intersection> {
    if !holds_points(min, max) {
        return None;
    }
    let t = match precision {
        Precision::Float => filtered::<f32, false>(ray, min, max).into_hit()?,
        Precision::Double => filtered::<f64, false>(ray, min, max).into_hit()?,
        Precision::Exact => match filtered::<f64, true>(ray, min, max) {
            Verdict::Hit(t) => t,
            Verdict::Miss => return None,
            Verdict::Undecided => intersect_exactly(ray, min, max)?,
        },
    };
    Some(Intersection { t, attributes: [0.0; 2], surface: Surface::Aabb })
}

/// Whether f64 decides this test, so that exact arithmetic is not needed (for statistics).
pub fn is_decided_in_f64(ray: &ObjectRay, min: [f32; 3], max: [f32; 3]) -> bool {
    !holds_points(min, max) || filtered::<f64, true>(ray, min, max) != Verdict::Undecided
}

/// The box itself as bounds; `None` if it is inactive or empty.
#[inline]
pub fn bounds(min: [f32; 3], max: [f32; 3]) -> Option<Bounds> {
    holds_points(min, max).then_some(Bounds { min, max })
}

/// Whether the box contains a finite point; false for NaNs.
fn holds_points(min: [f32; 3], max: [f32; 3]) -> bool {
    (0..3).all(|i| min[i] <= max[i] && min[i] < f32::INFINITY && max[i] > f32::NEG_INFINITY)
}

#[inline(always)]
fn filtered<R: Real, const BOUNDED: bool>(ray: &ObjectRay, min: [f32; 3], max: [f32; 3]) -> Verdict<f32> {
    let view = ray.bounded::<R>();
    let u2 = two_units::<R>();
    let infinite = R::ONE / R::ZERO;
    let t_min = view.t_min;
    if !(t_min <= view.t_max) {
        return Verdict::Miss;
    }
    // Lower and upper bounds of the entry (t_min included) and, an axis each, of n and f.
    let mut enter = (t_min, t_min);
    let mut near = [(-infinite, -infinite); 3];
    let mut far = [(infinite, infinite); 3];
    for i in 0..3 {
        let (o, d) = (view.origin[i], view.direction[i]);
        let eo = R::from_f64(ray.origin_error[i]) + u2 * o.abs();
        let ed = R::from_f64(ray.direction_error[i]) + u2 * d.abs();
        let (low, high) = (R::from_f32(min[i]), R::from_f32(max[i]));
        if d == R::ZERO && (!BOUNDED || ray.direction_error[i] == 0.0) {
            let eo = error_or_zero::<R, BOUNDED>(eo);
            if o + eo < low || o - eo > high {
                return Verdict::Miss;
            }
            let exact = ray.origin_error[i] == 0.0 && o >= low && o <= high;
            if BOUNDED && !exact && !(o - eo >= low && o + eo <= high) {
                return Verdict::Undecided;
            }
            continue;
        }
        let (entering, leaving) = if d > R::ZERO { (low, high) } else { (high, low) };
        let slab_t = |side: R| {
            let difference = side - o;
            let t = difference / d;
            let error = quotient_error(t, eo + u2 * difference.abs(), d, ed);
            let error = error_or_zero::<R, BOUNDED>(error);
            // An uncertain direction gives an infinite error beside an infinite t.
            if BOUNDED && !(error < infinite) { (-infinite, infinite) } else { (t - error, t + error) }
        };
        if entering.abs() < infinite {
            near[i] = slab_t(entering);
            enter = (enter.0.max(near[i].0), enter.1.max(near[i].1));
        }
        if leaving.abs() < infinite {
            far[i] = slab_t(leaving);
        }
    }
    let mut is_certain = true;
    for (i, far) in far.iter().enumerate() {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let first = near[j].0.max(near[k].0).max(t_min);
        let last = near[j].1.max(near[k].1).max(t_min);
        if first > far.1 {
            return Verdict::Miss;
        }
        is_certain &= last <= far.0;
    }
    if enter.0 > view.t_max {
        return Verdict::Miss;
    }
    is_certain &= enter.1 <= view.t_max;
    if !is_certain {
        return if BOUNDED { Verdict::Undecided } else { Verdict::Miss };
    }
    representable(rounded(enter.0, enter.1))
}

#[cold]
#[inline(never)]
fn intersect_exactly(ray: &ObjectRay, min: [f32; 3], max: [f32; 3]) -> Option<f32> {
    let (t_min, t_max) = (ray.t_min(), ray.t_max());
    let exact = ray.exact();
    let mut near: Option<Ratio> = None;
    let mut far: Option<Ratio> = None;
    for i in 0..3 {
        let d = &exact.direction[i];
        // Times the weight, from the origin; `None` for an infinite side.
        let side = |x: f32| x.is_finite().then(|| &(&Dyadic::from_f32(x) * &exact.weight) - &exact.origin[i]);
        let (low, high) = (side(min[i]), side(max[i]));
        if d.is_zero() {
            if low.is_some_and(|x| x.sign() > 0) || high.is_some_and(|x| x.sign() < 0) {
                return None;
            }
            continue;
        }
        let (entering, leaving) = if d.sign() > 0 { (low, high) } else { (high, low) };
        if let Some(n) = entering.map(|x| Ratio::new(x, d))
            && near.as_ref().is_none_or(|best| n.compare(best).is_gt())
        {
            near = Some(n);
        }
        if let Some(f) = leaving.map(|x| Ratio::new(x, d))
            && far.as_ref().is_none_or(|best| f.compare(best).is_lt())
        {
            far = Some(f);
        }
    }
    if let (Some(n), Some(f)) = (&near, &far)
        && n.compare(f).is_gt()
    {
        return None;
    }
    if far.is_some_and(|f| f.surd().compare_f32(t_min).is_lt()) || t_min > t_max {
        return None;
    }
    let t = match near.map(|n| n.surd()) {
        Some(n) if n.compare_f32(t_min).is_gt() => n.compare_f32(t_max).is_le().then(|| n.to_f32()),
        _ => Some(t_min + 0.0),
    };
    t.filter(|t| t.is_finite())
}

/// An exact quotient with a positive denominator.
struct Ratio {
    numerator: Dyadic,
    denominator: Dyadic,
}

impl Ratio {
    fn new(numerator: Dyadic, denominator: &Dyadic) -> Self {
        if denominator.sign() < 0 {
            Self { numerator: -&numerator, denominator: -denominator }
        } else {
            Self { numerator, denominator: denominator.clone() }
        }
    }

    fn compare(&self, other: &Self) -> Ordering {
        (&self.numerator * &other.denominator).compare(&(&other.numerator * &self.denominator))
    }

    fn surd(&self) -> Surd {
        Surd::ratio(self.numerator.clone(), self.denominator.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;

    fn hit(ray: Ray, min: [f32; 3], max: [f32; 3]) -> Option<f32> {
        let ray = ObjectRay::new(&ray, None).unwrap();
        intersect(&ray, min, max, Precision::Exact).map(|hit| hit.t)
    }

    const CUBE: ([f32; 3], [f32; 3]) = ([-1.0; 3], [1.0; 3]);

    #[test]
    fn the_entry_or_the_start_inside_counts() {
        let ray = Ray::new([-3.0, 0.0, 0.0], [2.0, 0.0, 0.0]);
        assert_eq!(hit(ray, CUBE.0, CUBE.1), Some(1.0));
        assert_eq!(hit(ray.with_interval(1.5, 9.0), CUBE.0, CUBE.1), Some(1.5));
        assert_eq!(hit(ray.with_interval(2.0, 9.0), CUBE.0, CUBE.1), Some(2.0));
        assert_eq!(hit(ray.with_interval(2.0f32.next_up(), 9.0), CUBE.0, CUBE.1), None);
        assert_eq!(hit(ray.with_interval(0.0, 1.0), CUBE.0, CUBE.1), Some(1.0));
        assert_eq!(hit(ray.with_interval(0.0, 1.0f32.next_down()), CUBE.0, CUBE.1), None);
        assert_eq!(hit(Ray::new([0.0; 3], [0.0; 3]), CUBE.0, CUBE.1), Some(0.0));
    }

    #[test]
    fn faces_edges_and_corners_are_closed() {
        // Along a face, along an edge, past the face by one step.
        assert_eq!(hit(Ray::new([-3.0, 1.0, 0.0], [1.0, 0.0, 0.0]), CUBE.0, CUBE.1), Some(2.0));
        assert_eq!(hit(Ray::new([-3.0, 1.0, -1.0], [1.0, 0.0, 0.0]), CUBE.0, CUBE.1), Some(2.0));
        assert_eq!(hit(Ray::new([-3.0, 1.0f32.next_up(), 0.0], [1.0, 0.0, 0.0]), CUBE.0, CUBE.1), None);
        // Diagonally through the edge x = -1, y = 1; below it, above it.
        let diagonal = |y: f32| hit(Ray::new([-3.0, y, 0.0], [1.0, 1.0, 0.0]), CUBE.0, CUBE.1);
        assert_eq!(diagonal(-1.0), Some(2.0));
        assert_eq!(diagonal((-1.0f32).next_down()), Some(2.0));
        assert_eq!(diagonal((-1.0f32).next_up()), None);
    }

    #[test]
    fn flat_and_infinite_boxes_work() {
        let inf = f32::INFINITY;
        let ray = Ray::new([-3.0, 0.0, 0.0], [1.0, 0.25, 0.0]);
        assert_eq!(hit(ray, [1.0, -9.0, -9.0], [1.0, 9.0, 9.0]), Some(4.0));
        assert_eq!(hit(ray, [1.0, 1.0, 0.0], [1.0, 1.0, 0.0]), Some(4.0));
        assert_eq!(hit(ray, [-inf; 3], [inf; 3]), Some(0.0));
        assert_eq!(hit(ray, [5.0, -inf, -inf], [inf, inf, inf]), Some(8.0));
        assert_eq!(hit(ray, [1.0, -9.0, 0.5], [1.0, 9.0, inf]), None);
    }

    #[test]
    fn boxes_without_points_are_never_hit() {
        let ray = Ray::new([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        let nan = f32::NAN;
        for (min, max) in [([nan, -1.0, -1.0], [1.0; 3]), ([1.0; 3], [-1.0; 3]), ([-1.0; 3], [1.0, nan, 1.0])]
        {
            assert_eq!(hit(ray, min, max), None);
            assert_eq!(bounds(min, max), None);
        }
    }
}
