//! Linear swept spheres: the convex hull of two spheres, one candidate a primitive.
//!
//! # Test
//! The ends are (P0, r0) and (P1, r1); D = P1 - P0, δ = r1 - r0, g = D.D - δ^2, w = origin - P0.
//! For g <= 0 the greater sphere contains the other and is tested alone. Otherwise the ball of the
//! sweep that the ray touches at t has the parameter u*(t) = (w.D + r0 δ + d.D t) / g, and the ray
//! enters
//! * cap 0, at the entry of sphere 0, if u* <= 0 there;
//! * the side, at the root of A t^2 + 2 B t + C at which it falls (the falling root), if 0 < u* < 1
//!   there;
//! * cap 1, at the entry of sphere 1, if u* >= 1 there.
//!
//! ```text
//! A = |d x D|^2 - |δ d|^2                  B = (w x D).(d x D) - (r0 D + δ w).(δ d)
//! C = |w x D|^2 - |r0 D + δ w|^2           B^2 - A C = g (|N|^2 - M^2)
//! N = r0 (d x D) + δ (d x w)               M = w.(d x D)
//! ```
//!
//! The ray misses if |N|^2 < M^2. An entry on a disabled cap is no candidate (SEMANTICS 9).
//!
//! An f64 filter from the point of closest approach (`f64_filter`) decides nearly all tests; the
//! others are evaluated as above with a running error bound, and then exactly (`exact`).
//!
//! # Degenerate shapes (SEMANTICS 9)
//! A NaN or infinity, or no positive radius: never hit. One negative radius: the shape ends in the
//! point where the interpolated radius reaches 0, at u = r0 / (r0 - r1); there is no sphere beyond,
//! and that point counts as side. Such shapes (invalid usage in Vulkan) always take the exact step.
//!
//! # Error
//! Products with d or w have the bounds of the table at `object_ray::BoundedRay`. A product of two
//! computed values has `math::error_bound::product_error`, a quotient `Divisor`; a root sqrt(g)
//! sqrt(G) of values known to e_g < g and e_G < G is off by at most (e_g / g + e_G / G + 3u) of
//! itself. The derivation, with the proof that one cap at most need be tested for A > 0, is in
//! `docs/derivations/linear-swept-sphere.md`.

mod exact;
mod f64_filter;

pub(super) use exact::normal as exact_normal;

use crate::geometry::bounded_ray::BoundedRay;
use crate::geometry::object_ray::ObjectRay;
use crate::geometry::verdict::{Verdict, error_or_zero, round_within_closed, rounded};
use crate::geometry::{Bounds, Intersection, Precision, Surface, sphere};
use crate::math::array;
use crate::math::error_bound::{Divisor, product_error, two_units};
use crate::math::f32x4::F32x4;
use crate::math::real::{Real, add, cross, dot, from_f32, norm1, scale, sub};

/// Where a ray enters a linear swept sphere, within the closed interval: ends `positions` and
/// `radii`, `caps` says which of the two caps are enabled. The attribute is u of the generating
/// sphere: exactly 0 or 1 on the caps, strictly between on the side.
#[inline(always)]
pub fn intersect(
    ray: &ObjectRay,
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
    caps: [bool; 2],
    precision: Precision,
) -> Option<Intersection> {
    match precision {
        Precision::Exact => match f64_filter::entry(ray, positions, radii, caps) {
            Verdict::Hit(hit) => Some(hit),
            Verdict::Miss => None,
            Verdict::Undecided => intersect_with_running_bound(ray, positions, radii, caps),
        },
        Precision::Float => intersect_in::<f32>(ray, positions, radii, caps),
        Precision::Double => intersect_in::<f64>(ray, positions, radii, caps),
    }
}

/// The test without bounds. It is not inlined, so that callers contain only the exact test.
#[inline(never)]
fn intersect_in<R: Real>(
    ray: &ObjectRay,
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
    caps: [bool; 2],
) -> Option<Intersection> {
    if !is_solid(positions, radii) {
        None
    } else if has_no_apex(radii) {
        filtered::<R, false>(ray, positions, radii, caps).into_hit()
    } else {
        exact::intersect(ray, positions, radii, caps)
    }
}

/// The test of rays that the filter leaves undecided.
#[cold]
#[inline(never)]
fn intersect_with_running_bound(
    ray: &ObjectRay,
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
    caps: [bool; 2],
) -> Option<Intersection> {
    if !is_solid(positions, radii) {
        return None;
    }
    if has_no_apex(radii) {
        match filtered::<f64, true>(ray, positions, radii, caps) {
            Verdict::Hit(hit) => return Some(hit),
            Verdict::Miss => return None,
            Verdict::Undecided => {}
        }
    }
    exact::intersect(ray, positions, radii, caps)
}

/// Whether f64 decides this test, so that exact arithmetic is not needed (for statistics).
pub fn is_decided_in_f64(
    ray: &ObjectRay,
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
    caps: [bool; 2],
) -> bool {
    !is_solid(positions, radii)
        || f64_filter::entry(ray, positions, radii, caps) != Verdict::Undecided
        || has_no_apex(radii) && filtered::<f64, true>(ray, positions, radii, caps) != Verdict::Undecided
}

/// The box around a linear swept sphere (with both caps); `None` where it is never hit.
#[inline]
pub fn bounds(positions: [[f32; 3]; 2], radii: [f32; 2]) -> Option<Bounds> {
    let [a, b] = array::map([0, 1], |end| {
        let [x, y, z] = positions[end];
        F32x4::new([x, y, z, radii[end]])
    });
    // Zero times an infinity or a NaN is a NaN.
    let is_finite = (a * F32x4::ZERO + b * F32x4::ZERO).cmp_ge(F32x4::ZERO) == 0b1111;
    if !is_finite || !(radii[0] > 0.0 || radii[1] > 0.0) {
        return None;
    }
    // An end of negative radius is cut off before its point: the point itself is enough.
    let [r0, r1] = array::map(radii, |radius| F32x4::splat(radius.max(0.0)));
    // One rounding to nearest each, undone by one step outwards.
    let [x0, y0, z0, _] = (a - r0).relaxed_min(b - r1).next_down().to_array();
    let [x1, y1, z1, _] = (a + r0).relaxed_max(b + r1).next_up().to_array();
    Some(Bounds { min: [x0, y0, z0], max: [x1, y1, z1] })
}

/// The boxes around both halves of a linear swept sphere, if their surfaces together are at most
/// three quarters of that of the box around the whole. `None` otherwise, and if it is never hit: an
/// infinity or a NaN makes the comparison false.
///
/// The shape is the union of the balls that lie at P0 + u D and have the radius r0 + u δ, where u
/// goes from 0 to 1; those of a half lie within the hull of its two end balls. The centre of the
/// middle ball, (P0 + P1) / 2, takes two products and a sum, its radius too; their difference and
/// sum round once, and again with the slack. These ten roundings are each at most a unit roundoff
/// of |P0| + |P1| + r0 + r1, or 2^-150 for subnormals; the slack is sixteen of both.
#[inline]
pub fn halves(positions: [[f32; 3]; 2], radii: [f32; 2]) -> Option<[Bounds; 2]> {
    let [p0, p1] = array::map(positions, |[x, y, z]| F32x4::new([x, y, z, 0.0]));
    let [r0, r1] = radii;
    // About half the surface of the boxes.
    let (length, width) = ((p1 - p0).abs(), r0 + r1);
    let surface = |part: f32| {
        let [x, y, z, _] = (length * F32x4::splat(part) + F32x4::splat(width)).to_array();
        x * y + y * z + z * x
    };
    // Written so that no infinity is halved.
    let smaller = r0 >= 0.0 && r1 >= 0.0 && 2.0 * surface(0.5) < 0.75 * surface(1.0);
    if !smaller || width == 0.0 {
        return None;
    }
    const ROUNDINGS: f32 = 16.0 / 16_777_216.0;
    let slack = (p0.abs() + p1.abs() + F32x4::splat(width)) * F32x4::splat(ROUNDINGS)
        + F32x4::splat(16.0 * f32::from_bits(1));
    let half = F32x4::splat(0.5);
    let ball = |center: F32x4, radius: f32| {
        let radius = F32x4::splat(radius);
        [center - radius - slack, center + radius + slack]
    };
    let ends = [ball(p0, r0), ball(p1, r1)];
    let middle = ball(p0 * half + p1 * half, r0 * 0.5 + r1 * 0.5);
    Some(ends.map(|end| {
        let three = |corner: F32x4| {
            let [x, y, z, _] = corner.to_array();
            [x, y, z]
        };
        Bounds { min: three(end[0].relaxed_min(middle[0])), max: three(end[1].relaxed_max(middle[1])) }
    }))
}

fn is_solid(positions: [[f32; 3]; 2], radii: [f32; 2]) -> bool {
    let finite = positions.as_flattened().iter().chain(&radii).all(|x| x.is_finite());
    finite && (radii[0] > 0.0 || radii[1] > 0.0)
}

/// Whether the shape does not end in an apex.
#[inline(always)]
fn has_no_apex(radii: [f32; 2]) -> bool {
    radii[0] >= 0.0 && radii[1] >= 0.0
}

/// A hit of the side; its u is never rounded to that of a cap.
fn side(t: f32, u: f32) -> Intersection {
    let u = u.clamp(f32::MIN_POSITIVE, 1.0f32.next_down());
    Intersection { t, attributes: [u, 0.0], surface: Surface::Side }
}

fn cap(t: f32, end: usize) -> Intersection {
    let surface = [Surface::Cap0, Surface::Cap1][end];
    Intersection { t, attributes: [end as f32, 0.0], surface }
}

#[inline(always)]
fn filtered<R: Real, const BOUNDED: bool>(
    ray: &ObjectRay,
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
    caps: [bool; 2],
) -> Verdict<Intersection> {
    let ray = &ray.bounded::<R>();
    let u2 = two_units::<R>();
    let ends: [[R; 3]; 2] = array::map(positions, from_f32);
    let [r0, r1] = array::map(radii, R::from_f32);

    let (d, dn, relative_error) = (ray.direction, ray.direction_norm, ray.relative_error);
    let axis = sub(ends[1], ends[0]);
    let axis_n = norm1(axis);
    let delta = r1 - r0;
    let slope = delta.abs();
    let w = sub(ray.origin, ends[0]);
    let wn = norm1(w);
    let error_bound = ray.error_bound(wn);

    // 2u for each rounded difference, 4u for its square and sum.
    let axis2 = dot(axis, axis);
    let g = axis2 - delta * delta;
    let e_g = error_or_zero::<R, BOUNDED>(u2 * R::from_f32(6.0) * (axis2 + delta * delta));
    if !(g > e_g) {
        // If the ends coincide, g = -δ^2 exactly.
        if BOUNDED && !(g < -e_g) && axis_n > R::ZERO {
            return Verdict::Undecided;
        }
        let outer = usize::from(r1 > r0);
        return single_sphere::<R, BOUNDED>(ray, ends[outer], [r0, r1][outer], outer, caps);
    }

    // This bounds the error of r0 D + δ w; |d| times this bounds N's error.
    let e_y = relative_error * (r0 * axis_n) + slope * error_bound;
    let c1 = cross(d, axis);
    let n = add(scale(r0, c1), scale(delta, cross(d, w)));
    let (nn, e_n) = (norm1(n), dn * e_y);
    let m = dot(w, c1);
    let (mn, e_m) = (m.abs(), dn * axis_n * error_bound);
    let (n2, m2) = (dot(n, n), m * m);
    let gram = n2 - m2;
    let e_gram = product_error(nn, e_n, nn, e_n) + product_error(mn, e_m, mn, e_m) + u2 * (n2 + m2);
    let e_gram = error_or_zero::<R, BOUNDED>(e_gram);
    if gram < -e_gram {
        return Verdict::Miss;
    }
    if BOUNDED && !(gram > e_gram) {
        return Verdict::Undecided;
    }
    let s = g.sqrt() * gram.sqrt();
    let e_s = s * (e_g / g + e_gram / gram + u2 + u2);

    let x = cross(w, axis);
    let (xn, e_x) = (norm1(x), axis_n * error_bound);
    let y = add(scale(r0, axis), scale(delta, w));
    let yn = norm1(y);
    let z = scale(delta, d);
    let (zn, e_z) = (slope * dn, relative_error * (slope * dn));
    let (c1n, e_c1) = (norm1(c1), relative_error * (dn * axis_n));
    let (c1c1, zz) = (dot(c1, c1), dot(z, z));
    let qa = c1c1 - zz;
    let e_qa = product_error(c1n, e_c1, c1n, e_c1) + product_error(zn, e_z, zn, e_z) + u2 * (c1c1 + zz);
    let (xc, yz) = (dot(x, c1), dot(y, z));
    let qb = xc - yz;
    let e_qb =
        product_error(xn, e_x, c1n, e_c1) + product_error(yn, e_y, zn, e_z) + u2 * (xc.abs() + yz.abs());
    let (numerator, e_numerator, denominator, e_denominator) = if qb <= R::ZERO {
        let (xx, yy) = (dot(x, x), dot(y, y));
        let e_qc = product_error(xn, e_x, xn, e_x) + product_error(yn, e_y, yn, e_y) + u2 * (xx + yy);
        let den = s - qb;
        (xx - yy, e_qc, den, e_s + e_qb + u2 * den)
    } else {
        let num = -(qb + s);
        (num, e_s + e_qb - u2 * num, qa, e_qa)
    };
    let (t, e_t) = quotient::<R, BOUNDED>(numerator, e_numerator, denominator, e_denominator);

    let sweep = SweepParameter {
        a: dot(w, axis) + r0 * delta,
        e_a: axis_n * error_bound + relative_error * (r0 * slope),
        b: dot(d, axis),
        e_b: relative_error * (dn * axis_n),
        g,
        e_g,
    };
    let (v, e_v) = sweep.at::<BOUNDED>(t, e_t);
    let below_one = sweep.below_one::<BOUNDED>(v, e_v);
    if v > e_v && below_one == Some(true) {
        let t = match round_within_closed::<R, BOUNDED>(ray, t, e_t) {
            Verdict::Hit(t) => t,
            Verdict::Miss => return Verdict::Miss,
            Verdict::Undecided => return Verdict::Undecided,
        };
        let (u, e_u) = quotient::<R, BOUNDED>(v, e_v, g, e_g);
        return match rounded(u - e_u, u + e_u) {
            Verdict::Hit(u) => Verdict::Hit(side(t, u)),
            _ => Verdict::Undecided,
        };
    }
    if qa > error_or_zero::<R, BOUNDED>(e_qa) {
        let end = if v < -e_v || (!BOUNDED && v <= R::ZERO) {
            0
        } else if below_one == Some(false) {
            1
        } else {
            return if BOUNDED { Verdict::Undecided } else { Verdict::Miss };
        };
        if !caps[end] {
            return Verdict::Miss;
        }
        return end_entry::<R, BOUNDED>(ray, &sweep, ends[end], [r0, r1][end], end, caps);
    }
    let end_0 = end_entry::<R, BOUNDED>(ray, &sweep, ends[0], r0, 0, caps);
    if end_0 != Verdict::Miss {
        return end_0;
    }
    let end_1 = end_entry::<R, BOUNDED>(ray, &sweep, ends[1], r1, 1, caps);
    // The ray enters neither end sphere. It may enter the side, unless u* is certainly outside (0,
    // 1).
    let is_outside = v < -e_v || below_one == Some(false);
    if BOUNDED && end_1 == Verdict::Miss && !is_outside { Verdict::Undecided } else { end_1 }
}

/// The quotient `n / d` of computed values that are off by at most `en` and `ed`, with its error
/// bound if `BOUNDED`.
#[inline(always)]
fn quotient<R: Real, const BOUNDED: bool>(n: R, en: R, d: R, ed: R) -> (R, R) {
    if BOUNDED { Divisor::new(d, ed).quotient(n, en) } else { (n / d, R::ZERO) }
}

/// u* g = a + b t along the line, with error bounds.
struct SweepParameter<R> {
    a: R,
    e_a: R,
    b: R,
    e_b: R,
    g: R,
    e_g: R,
}

impl<R: Real> SweepParameter<R> {
    /// a + b t and its error.
    #[inline(always)]
    fn at<const BOUNDED: bool>(&self, t: R, e_t: R) -> (R, R) {
        let bt = self.b * t;
        let e = self.e_a
            + product_error(self.b.abs(), self.e_b, t.abs(), e_t)
            + two_units::<R>() * (self.a.abs() + bt.abs());
        (self.a + bt, error_or_zero::<R, BOUNDED>(e))
    }

    /// Whether u* < 1; `None` only if the bound leaves it undecided.
    #[inline(always)]
    fn below_one<const BOUNDED: bool>(&self, v: R, e_v: R) -> Option<bool> {
        let rest = self.g - v;
        let e = error_or_zero::<R, BOUNDED>(e_v + self.e_g + two_units::<R>() * (self.g + v.abs()));
        if rest > e {
            Some(true)
        } else if rest < -e || !BOUNDED {
            Some(false)
        } else {
            None
        }
    }
}

/// The hull's entry if it lies on the sphere of one end; otherwise a miss.
#[inline(always)]
fn end_entry<R: Real, const BOUNDED: bool>(
    ray: &BoundedRay<R>,
    sweep: &SweepParameter<R>,
    center: [R; 3],
    radius: R,
    end: usize,
    caps: [bool; 2],
) -> Verdict<Intersection> {
    let (t, e_t) = match sphere::entry::<R, BOUNDED>(ray, center, radius) {
        Verdict::Hit(entry) => entry,
        Verdict::Miss => return Verdict::Miss,
        Verdict::Undecided => return Verdict::Undecided,
    };
    let (v, e_v) = sweep.at::<BOUNDED>(t, e_t);
    let is_owned = if end == 0 {
        if v > e_v {
            Some(false)
        } else if v < -e_v || !BOUNDED {
            Some(true)
        } else {
            None
        }
    } else {
        sweep.below_one::<BOUNDED>(v, e_v).map(|below| !below)
    };
    match is_owned {
        Some(true) => on_cap::<R, BOUNDED>(ray, t, e_t, end, caps),
        Some(false) => Verdict::Miss,
        None => Verdict::Undecided,
    }
}

#[inline(always)]
fn single_sphere<R: Real, const BOUNDED: bool>(
    ray: &BoundedRay<R>,
    center: [R; 3],
    radius: R,
    end: usize,
    caps: [bool; 2],
) -> Verdict<Intersection> {
    match sphere::entry::<R, BOUNDED>(ray, center, radius) {
        Verdict::Hit((t, e_t)) => on_cap::<R, BOUNDED>(ray, t, e_t, end, caps),
        Verdict::Miss => Verdict::Miss,
        Verdict::Undecided => Verdict::Undecided,
    }
}

#[inline(always)]
fn on_cap<R: Real, const BOUNDED: bool>(
    ray: &BoundedRay<R>,
    t: R,
    e_t: R,
    end: usize,
    caps: [bool; 2],
) -> Verdict<Intersection> {
    if !caps[end] {
        return Verdict::Miss;
    }
    match round_within_closed::<R, BOUNDED>(ray, t, e_t) {
        Verdict::Hit(t) => Verdict::Hit(cap(t, end)),
        Verdict::Miss => Verdict::Miss,
        Verdict::Undecided => Verdict::Undecided,
    }
}
