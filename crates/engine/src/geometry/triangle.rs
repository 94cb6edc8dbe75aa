//! Triangles, watertight and scale-free.
//!
//! # Derivation
//! With e1 = V1 - V0, e2 = V2 - V0, w = origin - V0, p = d x e2, q = w x e1 (Möller and Trumbore,
//! *Fast, Minimum Storage Ray/Triangle Intersection*, 1997):
//!
//! ```text
//! det = e1.p      beta = w.p      gamma = d.q      alpha = det - beta - gamma      t = e2.q / det
//! ```
//!
//! alpha, beta, gamma over det are the barycentrics of V0, V1, V2. The ray's line meets the
//! triangle where all three have the sign of det; det == 0 is edge-on or degenerate and never a
//! hit. Each is, up to sign, the volume of the line with one *edge*, d.((B - o) x (C - o)): as its
//! sign is decided exactly, the two triangles of an edge get opposite answers and no ray passes
//! between them.
//!
//! **On an edge or vertex** exactly one of the neighbours must be hit. The ray counts as moved by
//! (ε, ε^2) along two axes i, j of object space (simulation of simplicity: Edelsbrunner and Mücke,
//! 1990), the two that are left when an axis is set aside along which d is greatest. The move
//! depends on the ray alone, so all triangles of an instance see the same one, and a line in
//! general position meets a closed fan once. Along axis i it changes beta by ε p_i, gamma by ε (e1
//! x d)_i and det not at all. If beta and both its terms are 0, p is parallel to the axis set aside
//! and normal to d, so that p = 0 and det = 0; likewise for the others: the sign is never left
//! open. Attributes and t are those of the unmoved ray.
//!
//! **Facing** (SEMANTICS 4.2): front where the vertices run clockwise as seen from the ray in a
//! left-handed system, that is d.(e1 x e2) < 0, that is det > 0. Decided in object space.
//!
//! # Steps
//! The f64 filter takes one triangle (`one`) or the four of a block (`four`). The bounds of det,
//! beta, gamma and e2.q are rows of the table at `object_ray::BoundedRay`, quotients have
//! `math::error_bound::Divisor`. Products stay within 2^-450 and 2^520. What it leaves undecided is
//! decided exactly: in integers of 128 bits (`integers`) where these hold the coordinates, in
//! arbitrary precision elsewhere.

mod four;
mod integers;
mod one;

use crate::geometry::double_ray::DoubleRay;
use crate::geometry::object_ray::ObjectRay;
use crate::geometry::verdict::Verdict;
use crate::geometry::{Bounds, Intersection, Precision, Surface};
use crate::math::array;
use crate::math::baseline_simd::BaselineSimd;
use crate::math::exact::{self, Dyadic};
use crate::math::real::{Real, cross, dot, from_f32, sub};
use crate::math::surd::Surd;

pub(super) use four::intersect4;
pub(super) use one::intersect_simd;

/// Where a ray meets a triangle, strictly within the interval. The attributes are the barycentrics
/// of the second and third vertex. A triangle with a vertex that is not finite is never hit.
#[inline(always)]
pub fn intersect(ray: &ObjectRay, vertices: [[f32; 3]; 3], precision: Precision) -> Option<Intersection> {
    match precision {
        Precision::Float => intersect_in::<f32>(ray, vertices),
        Precision::Double => intersect_in::<f64>(ray, vertices),
        Precision::Exact => match f64_filter(ray, vertices) {
            Verdict::Hit(hit) => Some(hit),
            Verdict::Miss => None,
            Verdict::Undecided => settle(ray, vertices),
        },
    }
}

#[inline(always)]
fn f64_filter(ray: &ObjectRay, vertices: [[f32; 3]; 3]) -> Verdict<Intersection> {
    intersect_simd(BaselineSimd, &DoubleRay::of(BaselineSimd, ray), vertices)
}

/// Whether f64 decides this test, so that exact arithmetic is not needed (for statistics).
pub fn is_decided_in_f64(ray: &ObjectRay, vertices: [[f32; 3]; 3]) -> bool {
    f64_filter(ray, vertices) != Verdict::Undecided
}

/// The box around a triangle; `None` where it is inactive (a NaN in the X of a vertex, SEMANTICS
/// 2.6) or, with another component not finite, can't be hit.
pub fn bounds(vertices: [[f32; 3]; 3]) -> Option<Bounds> {
    is_finite(vertices).then(|| Bounds::of_points(&vertices))
}

fn is_finite(vertices: [[f32; 3]; 3]) -> bool {
    vertices.as_flattened().iter().all(|x| x.is_finite())
}

/// The test without bounds. It is not inlined, so that callers contain only the exact test.
#[inline(never)]
fn intersect_in<R: Real>(ray: &ObjectRay, vertices: [[f32; 3]; 3]) -> Option<Intersection> {
    let ray = &ray.bounded::<R>();
    let [v0, v1, v2] = array::map(vertices, from_f32::<R>);
    let d = ray.direction;
    let (e1, e2, w) = (sub(v1, v0), sub(v2, v0), sub(ray.origin, v0));
    let (p, q) = (cross(d, e2), cross(w, e1));
    let (det, beta, gamma) = (dot(e1, p), dot(w, p), dot(d, q));
    let alpha = det - beta - gamma;
    let some_negative = (alpha < R::ZERO) | (beta < R::ZERO) | (gamma < R::ZERO);
    let some_positive = (alpha > R::ZERO) | (beta > R::ZERO) | (gamma > R::ZERO);
    // Written so that a NaN is none.
    if some_negative & some_positive || !(det.abs() > R::ZERO) {
        return None;
    }
    let t = dot(e2, q) / det;
    let is_within = t > ray.t_min && t < ray.t_max;
    let [t, b1, b2] = array::map([t, beta / det, gamma / det], |x| x.to_f32() + 0.0);
    let hit = Intersection { t, attributes: [b1, b2], surface: facing(det > R::ZERO) };
    // An overflow makes NaNs.
    (is_within && t.is_finite() && !b1.is_nan() && !b2.is_nan()).then_some(hit)
}

fn facing(front: bool) -> Surface {
    if front { Surface::TriangleFront } else { Surface::TriangleBack }
}

/// Decides exactly.
#[cold]
#[inline(never)]
fn settle(ray: &ObjectRay, vertices: [[f32; 3]; 3]) -> Option<Intersection> {
    match integers::intersect(ray, vertices) {
        Verdict::Hit(hit) => Some(hit),
        Verdict::Miss => None,
        Verdict::Undecided => intersect_exactly(ray, vertices),
    }
}

/// Decides in arbitrary precision.
#[cold]
#[inline(never)]
fn intersect_exactly(ray: &ObjectRay, vertices: [[f32; 3]; 3]) -> Option<Intersection> {
    if !is_finite(vertices) {
        return None;
    }
    let exact_ray = ray.exact();
    let [v0, v1, v2] = vertices.map(exact::vector);
    let d = &exact_ray.direction;
    let w = exact_ray.origin_from(&v0);
    let e1 = exact::scale(&exact_ray.weight, &exact::sub(&v1, &v0));
    let e2 = exact::scale(&exact_ray.weight, &exact::sub(&v2, &v0));

    let p = exact::cross(d, &e2);
    let det = exact::dot(&e1, &p);
    if det.is_zero() {
        return None;
    }
    let q = exact::cross(&w, &e1);
    let beta = exact::dot(&w, &p);
    let gamma = exact::dot(d, &q);
    let alpha = &(&det - &beta) - &gamma;

    let across = exact::cross(&e1, d);
    let perturbed = axes_across(d);
    let sign = |value: &Dyadic, change: &dyn Fn(usize) -> i32| {
        [value.sign(), change(perturbed[0]), change(perturbed[1])].into_iter().find(|&sign| sign != 0)
    };
    let side = Some(det.sign());
    let inside = sign(&beta, &|i| p[i].sign()) == side
        && sign(&gamma, &|i| across[i].sign()) == side
        && sign(&alpha, &|i| -(&p[i] + &across[i]).sign()) == side;
    if !inside {
        return None;
    }
    let t = ray.round_within_open(&Surd::ratio(exact::dot(&e2, &q), det.clone()))?;
    let attributes = [beta, gamma].map(|numerator| Surd::ratio(numerator, det.clone()).to_f32());
    Some(Intersection { t, attributes, surface: facing(det.sign() > 0) })
}

/// The two axes other than that of the greatest component of the direction.
fn axes_across(d: &exact::Vector) -> [usize; 2] {
    let mut greatest = 0;
    for axis in 1..3 {
        if d[axis].abs().compare(&d[greatest].abs()).is_gt() {
            greatest = axis;
        }
    }
    [(greatest + 1) % 3, (greatest + 2) % 3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;

    const UNIT: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    fn hit(ray: Ray, vertices: [[f32; 3]; 3]) -> Option<Intersection> {
        intersect(&ObjectRay::new(&ray, None).unwrap(), vertices, Precision::Exact)
    }

    fn down(x: f32, y: f32) -> Ray {
        Ray::new([x, y, 2.0], [0.0, 0.0, -1.0])
    }

    #[test]
    fn barycentrics_belong_to_the_second_and_third_vertex() {
        let found = hit(down(0.25, 0.5), UNIT).unwrap();
        assert_eq!((found.t, found.attributes), (2.0, [0.25, 0.5]));
        // e1 x e2 = +z runs against the ray: front (SEMANTICS 4.2).
        assert_eq!(found.surface, Surface::TriangleFront);
        let turned = hit(down(0.25, 0.5), [UNIT[0], UNIT[2], UNIT[1]]).unwrap();
        assert_eq!((turned.attributes, turned.surface), ([0.5, 0.25], Surface::TriangleBack));
    }

    #[test]
    fn the_interval_is_open() {
        let at = |t_min, t_max| hit(down(0.25, 0.25).with_interval(t_min, t_max), UNIT).is_some();
        assert!(at(0.0, 2.0f32.next_up()) && at(2.0f32.next_down(), 3.0));
        assert!(!at(0.0, 2.0) && !at(2.0, 3.0));
    }

    #[test]
    fn edge_on_and_degenerate_triangles_are_never_hit() {
        assert!(hit(Ray::new([-1.0, 0.25, 0.0], [1.0, 0.0, 0.0]), UNIT).is_none());
        assert!(hit(down(0.25, 0.25), [UNIT[0], UNIT[1], UNIT[1]]).is_none());
        assert!(hit(down(0.25, 0.25), [[0.0; 3], [0.5, 0.5, 0.0], [0.25, 0.25, 0.0]]).is_none());
        assert!(hit(down(0.25, 0.25), [[f32::NAN, 0.0, 0.0], UNIT[1], UNIT[2]]).is_none());
        assert!(bounds([[0.0, f32::NAN, 0.0], UNIT[1], UNIT[2]]).is_none());
    }

    #[test]
    fn an_edge_belongs_to_one_of_its_triangles() {
        // A square cut along either diagonal, all windings: its inner points are hit once.
        let c = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        for halves in [[[0, 1, 2], [0, 2, 3]], [[2, 0, 1], [3, 2, 0]], [[0, 1, 3], [3, 1, 2]]] {
            for x in [0.125, 0.25, 0.5, 0.875] {
                for y in [x, 1.0 - x] {
                    let count = halves.iter().filter(|h| hit(down(x, y), h.map(|i| c[i])).is_some()).count();
                    assert_eq!(count, 1, "{x} {y} {halves:?}");
                }
            }
        }
    }

    #[test]
    fn a_fans_centre_is_hit_once() {
        let rim = [[1.0, 0.0], [0.5, 2.0], [-1.0, 0.5], [-3.0, -0.25], [0.0, -1.0f32]];
        let at = |i: usize| [rim[i % 5][0], rim[i % 5][1], rim[i % 5][0] * 0.5];
        for direction in [[0.0, 0.0, -1.0], [0.25, 0.5, -1.0], [-0.5, 0.125, -1.0f32]] {
            let ray = Ray::new(direction.map(|x| x * -2.0), direction);
            let count = (0..5).filter(|&i| hit(ray, [[0.0; 3], at(i), at(i + 1)]).is_some()).count();
            assert_eq!(count, 1, "{direction:?}");
        }
    }
}
