//! The exact test in integers of 128 bits.
//!
//! Rays through edges and vertices of a mesh are undecided in f64 for every triangle around them.
//! Where the coordinates of the ray's origin and of the triangle are multiples of a power of two
//! 2^k, and below 2^(k + 40), they are integers of 40 bits in units of 2^k; so are the components
//! of the direction in units of their own. Differences have 41 bits, and with p, q, det, beta and
//! gamma of `triangle`:
//!
//! ```text
//! |p| < 2 * 2^40 * 2^41 = 2^82      |q| < 2 * 2^41 * 2^41 = 2^83
//! |det|, |beta| < 3 * 2^41 * 2^82 < 2^125      |gamma| < 3 * 2^40 * 2^83 < 2^125
//! |alpha| < 3 * 2^125 < 2^127      |e2.q| < 3 * 2^41 * 2^83 < 2^126
//! ```
//!
//! Nothing overflows, and all signs are exact. Quotients are rounded to f64 first, off by less than
//! 4u relatively; a quotient that this does not decide is left to arbitrary precision, and so are
//! other coordinates and rays that a transform rounds.

use super::facing;
use crate::geometry::Intersection;
use crate::geometry::object_ray::ObjectRay;
use crate::geometry::verdict::Verdict;
use crate::math::array;

/// The number of bits of a coordinate.
const BITS: i32 = 40;

/// A bound of the relative error of a quotient in f64; 2^-50.
const QUOTIENT_ERROR: f64 = 8.0 * (f64::EPSILON / 2.0);

/// Tests one triangle; decides nothing but what is exact.
pub(super) fn intersect(ray: &ObjectRay, vertices: [[f32; 3]; 3]) -> Verdict<Intersection> {
    let ([a, b, c], [d, e, f]) = (ray.origin_error, ray.direction_error);
    if a + b + c + d + e + f != 0.0 {
        return Verdict::Undecided;
    }
    let [v0, v1, v2] = array::map(vertices, |vertex| array::map(vertex, f64::from));
    let (Some((unit, [origin, v0, v1, v2])), Some((direction_unit, [d]))) =
        (integers(&[ray.origin, v0, v1, v2]), integers(&[ray.direction]))
    else {
        return Verdict::Undecided;
    };
    let (w, e1, e2) = (sub(origin, v0), sub(v1, v0), sub(v2, v0));
    let p = cross(d, e2);
    let det = dot(e1, p);
    if det == 0 {
        return Verdict::Miss;
    }
    let is_inside = |value: i128, change: &dyn Fn(usize) -> i128| {
        let [i, j] = axes_across(d);
        let sign = match value {
            0 if change(i) == 0 => change(j),
            0 => change(i),
            value => value,
        };
        sign.signum() == det.signum()
    };
    let beta = dot(w, p);
    if !is_inside(beta, &|i| p[i]) {
        return Verdict::Miss;
    }
    let (q, across) = (cross(w, e1), cross(e1, d));
    let gamma = dot(d, q);
    if !is_inside(gamma, &|i| across[i]) || !is_inside(det - beta - gamma, &|i| -(p[i] + across[i])) {
        return Verdict::Miss;
    }
    // In units of the coordinates by those of the direction.
    let t = quotient(dot(e2, q), det) * 2f64.powi(unit - direction_unit);
    let [low, high] = bounds(t);
    let (t_min, t_max) = (f64::from(ray.t_min()), f64::from(ray.t_max()));
    if high < t_min || low > t_max || t == 0.0 && !(t_min < 0.0 && 0.0 < t_max) {
        return Verdict::Miss;
    }
    let rounded = [rounded(t), rounded(quotient(beta, det)), rounded(quotient(gamma, det))];
    match rounded {
        [Some(t), Some(b1), Some(b2)] if low > t_min && high < t_max => {
            Verdict::Hit(Intersection { t, attributes: [b1, b2], surface: facing(det > 0) })
        }
        _ => Verdict::Undecided,
    }
}

type Vector = [i64; 3];

/// Points as integers of [`BITS`] bits, in units of a power of two, whose exponent is returned,
/// too.
///
/// The unit is the smallest in which the greatest coordinate has [`BITS`] bits. Scaling by a power
/// of two rounds nothing, and a number that is an integer afterwards keeps its value in both
/// conversions.
#[inline]
fn integers<const N: usize>(points: &[[f64; 3]; N]) -> Option<(i32, [Vector; N])> {
    let mut most = 0.0;
    for at in 0..3 * N {
        let size = points[at / 3][at % 3].abs();
        // Also takes a NaN, which no integer equals.
        most = if size <= most { most } else { size };
    }
    // |x| < 2^(exponent + 1).
    let exponent = (most.to_bits() >> 52) as i32 - 1023;
    let unit = exponent + 1 - BITS;
    if most == 0.0 {
        return Some((0, [[0; 3]; N]));
    }
    // So that the scale is a normal number. Those of f32 are far from the ends.
    if !(-900..900).contains(&unit) {
        return None;
    }
    let scale = f64::from_bits(((1023 - unit) as u64) << 52);
    let mut all = [[0; 3]; N];
    let mut is_exact = true;
    for at in 0..3 * N {
        let scaled = points[at / 3][at % 3] * scale;
        let integer = scaled as i64;
        is_exact &= integer as f64 == scaled;
        all[at / 3][at % 3] = integer;
    }
    is_exact.then_some((unit, all))
}

#[inline]
fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
fn cross(a: Vector, b: Vector) -> [i128; 3] {
    let minor =
        |i: usize, j: usize| i128::from(a[i]) * i128::from(b[j]) - i128::from(a[j]) * i128::from(b[i]);
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

#[inline]
fn dot(a: Vector, b: [i128; 3]) -> i128 {
    i128::from(a[0]) * b[0] + i128::from(a[1]) * b[1] + i128::from(a[2]) * b[2]
}

/// The two axes other than that of the greatest component of the direction.
#[inline]
fn axes_across(d: Vector) -> [usize; 2] {
    let mut greatest = 0;
    for axis in 1..3 {
        if d[axis].abs() > d[greatest].abs() {
            greatest = axis;
        }
    }
    [(greatest + 1) % 3, (greatest + 2) % 3]
}

/// A quotient, off by less than 4u relatively; 0 only where it is 0.
#[inline]
fn quotient(numerator: i128, denominator: i128) -> f64 {
    numerator as f64 / denominator as f64
}

/// Bounds of a quotient that was computed.
#[inline]
fn bounds(quotient: f64) -> [f64; 2] {
    let error = quotient.abs() * QUOTIENT_ERROR;
    [quotient - error, quotient + error]
}

/// A quotient, correctly rounded; `None` where its error leaves it open, and for infinity.
#[inline]
fn rounded(quotient: f64) -> Option<f32> {
    let [low, high] = array::map(bounds(quotient), |x| x as f32);
    (low == high && low.is_finite()).then_some(low + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::triangle::intersect_exactly;
    use crate::geometry::{Ray, Transform};
    use crate::math::random::Random;

    /// Compares with arbitrary precision; returns whether the test was decided.
    fn check(ray: &ObjectRay, vertices: [[f32; 3]; 3]) -> bool {
        let wanted = intersect_exactly(ray, vertices);
        match intersect(ray, vertices) {
            Verdict::Undecided => return false,
            Verdict::Miss => assert_eq!(wanted, None, "{ray:?} {vertices:?}"),
            Verdict::Hit(hit) => assert_eq!(Some(hit), wanted, "{ray:?} {vertices:?}"),
        }
        true
    }

    #[test]
    fn rays_through_vertices_and_edges_are_decided_as_in_arbitrary_precision() {
        let mut random = Random::new(23);
        let (mut decided, count) = (0, 4000);
        for at in 0..count {
            // Few places, so that many rays run through vertices, along edges and beside planes.
            let mut point = || [0; 3].map(|_| random.below(5) as f32 * 0.75 - 1.5);
            let (vertices, target, origin) = ([point(), point(), point()], point(), point());
            let target = if at % 2 == 0 { vertices[at % 3] } else { target };
            let mut direction = [0, 1, 2].map(|axis| target[axis] - origin[axis]);
            if at % 5 == 0 {
                direction = [0.0, 0.0, -0.5];
            }
            let t_max = if at % 7 == 0 { 1.0 } else { f32::INFINITY };
            let ray = Ray::new(origin, direction).with_interval(0.0, t_max);
            decided += usize::from(check(&ObjectRay::new(&ray, None).unwrap(), vertices));
        }
        // All but those whose t is exactly the end of the interval.
        assert!(decided > count * 9 / 10, "{decided}");
    }

    #[test]
    fn any_coordinates_are_decided_as_in_arbitrary_precision_or_not() {
        let mut random = Random::new(29);
        let mut decided = 0;
        for at in 0..4000 {
            let spread = [0, 4, 12, 30][at % 4];
            let mut number = || {
                let scale = 2f32.powi(random.below(spread + 1) as i32 - spread as i32 / 2);
                (random.unit() - 0.5) * scale
            };
            let mut point = || [number(), number(), number()];
            let vertices = [point(), point(), point()];
            let (origin, direction) = match at % 3 {
                0 => (point(), point()),
                // Straight down onto a vertex.
                _ => ([vertices[0][0], vertices[0][1], 4.0], [0.0, 0.0, -1.0]),
            };
            let ray = Ray::new(origin, direction);
            decided += usize::from(check(&ObjectRay::new(&ray, None).unwrap(), vertices));
        }
        assert!((1000..4000).contains(&decided), "{decided}");
    }

    #[test]
    fn transforms_that_round_nothing_are_decided_too() {
        let ray = Ray::new([1.5, 2.25, 4.0], [0.0, 0.0, -1.0]);
        let vertices = [[0.25, 0.5, 0.0], [1.25, 0.5, 0.0], [0.25, 1.5, 0.0]];
        let object_ray =
            |rows: [[f32; 4]; 3]| ObjectRay::in_instance(&ray, &Transform::new(&rows).unwrap()).unwrap();
        // The first vertex lies at (1.5, 2.25).
        let moved = object_ray([[2.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, 1.25], [0.0, 0.0, 1.0, 0.0]]);
        assert!(check(&moved, vertices));
        let turned = object_ray([[0.6, -0.8, 0.0, 1.0], [0.8, 0.6, 0.0, 1.25], [0.0, 0.0, 1.0, 0.0]]);
        assert_eq!(intersect(&turned, vertices), Verdict::Undecided);
    }

    #[test]
    fn the_greatest_coordinates_do_not_overflow() {
        // The greatest f32 below 2^40 has 40 bits in units of 1.
        let (most, unit) = (((1u64 << 40) as f32).next_down(), 1.0f32);
        let corners = [[-most, -most, unit], [most, -most, -most], [-most, most, most]];
        for direction in [[most, -most, unit], [-most, -most, -most], [unit, most, -most]] {
            let ray = Ray::new([most, most, most], direction);
            assert!(check(&ObjectRay::new(&ray, None).unwrap(), corners), "{direction:?}");
        }
    }
}
