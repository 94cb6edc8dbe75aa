//! Blocks of four primitives as a structure of arrays, and an f32 test that culls those that a ray
//! certainly misses.
//!
//! A ray misses most primitives of a leaf, and a miss needs no t, only the sign of one or two
//! polynomials. [`CullRay`] is the ray in f32 with error bounds; each `maybe_hit_mask` evaluates
//! the silhouettes of four primitives and keeps a lane unless the bound proves a miss. Lanes that
//! are kept go to `intersect`, which decides. So culling affects only time. There is one
//! implementation for all machines (`math::f32x4`).
//!
//! # The ray
//! The exact object-space ray o + t d is reparametrised: the origin moves by `t0` along it towards
//! the primitives if it starts far from them, and the direction is scaled so that its greatest
//! component is of a magnitude from 1 to 2. With o' and D = λ d (λ > 0) the exact results and O, E
//! their f32 neighbours,
//!
//! ```text
//! |O - o'| <= e          |E - D| <= κ |E|          |E| >= 1          (1-norms)
//! ```
//!
//! where e and κ are sums of the f64 error bounds of `ObjectRay` (origin, and t0 times the
//! direction's), of the f64 roundings made here, and of the roundings to f32, which are *measured*:
//! the difference of an f64 and its f32 neighbour is exact. A ray in world space that starts near
//! the primitives has e = 0.
//!
//! # The bounds
//! The table at `object_ray::BoundedRay` holds with u = 2^-24, `origin_error` e, c = κ + 12u. Each
//! test lists what it uses. Spheres and swept spheres take one bound for all primitives, |E| (e + c
//! x): x is at least the 1-norm of the vector from o' to any point of the box around all, and so at
//! least |o' - p| + r for a centre p and a radius r. The bounds are evaluated in f32 by sums,
//! products and square roots of non-negative terms, which lose at most 2^-24 relatively each;
//! `margin` = 1 + 2^-18 on every source outweighs 60 of those.
//!
//! *Underflow* costs at most 2^-150 per operation. e is raised by 2^-60, so that each bound's
//! square is at least 2^-120 and its margin, 2^-138, outweighs the few such losses of any formula
//! below. *Overflow*: for primitives or an origin o' beyond 2^60, and for values that are not
//! finite, e is infinite. Every comparison is written so that an infinite bound, and a NaN from it,
//! keeps the lane.

mod aabb;
mod linear_swept_sphere;
mod sphere;
mod triangle;

use crate::geometry::{ApproximateRay, Bounds, ObjectRay, Ray};
use crate::math::array;
use crate::math::f32x4::F32x4;
use crate::math::real::Real;

/// The number of primitives in a block.
pub use crate::math::f32x4::LANES;
pub use aabb::{Aabb4, BoxRay};
pub use linear_swept_sphere::LinearSweptSphere4;
pub use sphere::Sphere4;
pub use triangle::{ShearedRay, Triangle4};

/// The mask of all lanes.
const ALL_LANES: u32 = (1 << LANES) - 1;

/// The greatest coordinate for which the bounds hold: 2^60.
const MAX_COORDINATE: f32 = (1u64 << 60) as f32;

/// The unit roundoff of f32.
const UNIT: f64 = 1.0 / 16_777_216.0;

/// Outweighs the roundings of evaluating a bound in f32.
const MARGIN: f64 = 1.0 + 1.0 / 262_144.0;

/// A ray in f32 with error bounds, prepared for the blocks of one BLAS.
#[derive(Clone, Copy, Debug)]
pub struct CullRay {
    origin: [f32; 3],
    /// Scaled so that its greatest component has a magnitude from 1 to 2.
    direction: [f32; 3],
    /// The axis of that component.
    axis: usize,
    /// |E| e, with margin: the part of a bound that does not depend on the primitive.
    absolute_error: f32,
    /// |E| c, with margin: the part that grows with the primitive's distance.
    relative_error: f32,
    /// |E| (e + c x), with margin, x being the greatest distance of all primitives and their radii.
    error_bound: f32,
    /// `error_bound`, but infinite if hits behind the origin count.
    behind_error_bound: f32,
    /// An upper bound of the 2-norm of D.
    length: f32,
    /// 5.5 |E| ρ, 10 |E|^2 c and |E|^2, with `error_bound` for ρ, for the cones of swept spheres.
    cone_terms: [f32; 3],
}

/// The error bounds that [`CullRay::prepare`] also computes.
struct CullErrors {
    /// For each component of the origin.
    origin: [f64; 3],
    direction: [f64; 3],
    t0: f64,
}

impl CullRay {
    /// Placeholder value that culls nothing.
    pub const EMPTY: Self = Self {
        origin: [0.0; 3],
        direction: [0.0; 3],
        axis: 0,
        absolute_error: f32::INFINITY,
        relative_error: f32::INFINITY,
        error_bound: f32::INFINITY,
        behind_error_bound: f32::INFINITY,
        length: f32::INFINITY,
        cone_terms: [f32::INFINITY; 3],
    };

    /// Prepares a ray for primitives that lie within the given box (object space); for boxes there
    /// is [`BoxRay`].
    #[inline]
    pub fn new(ray: &ObjectRay, around: &Bounds) -> Self {
        let world_space = if ray.is_in_world() { Self::world_space(ray.world(), around) } else { None };
        world_space.unwrap_or_else(|| Self::prepare(ray, around).0)
    }

    /// The common case in f32 throughout: a ray in world space that starts near the primitives,
    /// with a direction whose greatest component is of a magnitude from 2^-60 to 2^60. `None` for
    /// any other.
    ///
    /// Origin and direction are exact then, as the direction is scaled by a power of two, and e =
    /// 2^-60. (Underflow costs 2^-150 at most, which at a distance of 2^60 is far below e.) 16u
    /// covers 12u and the roundings here.
    #[inline(always)]
    pub fn world_space(ray: &Ray, around: &Bounds) -> Option<Self> {
        let far = max_distance(xyz0(ray.origin), around);
        let (axis, most) = max_component(ray.direction);
        // Written so that a NaN does not fit.
        let near = far <= 64.0 * sum_xyz(xyz0(around.max) - xyz0(around.min)) && far <= MAX_COORDINATE;
        if !(near && most <= MAX_COORDINATE && most * MAX_COORDINATE >= 1.0) {
            return None;
        }
        let along = xyz0(ray.direction) * F32x4::splat(inverse_power_of_two(most));
        let norm = sum_xyz(along.abs());
        let absolute_error = norm * (TINY * MARGIN * MARGIN) as f32;
        let relative_error = norm * (16.0 * UNIT) as f32;
        let error_bound = absolute_error + relative_error * far;
        let length = sum_xyz(along * along).sqrt() * (1.0 + 1.0 / 65_536.0);
        Some(Self {
            origin: ray.origin,
            direction: xyz(along),
            axis,
            absolute_error,
            relative_error,
            error_bound,
            behind_error_bound: if ray.t_min >= 0.0 { error_bound } else { f32::INFINITY },
            length,
            cone_terms: cone_terms(relative_error, error_bound, length),
        })
    }

    /// A ray in the object space of an instance, in f32 throughout. `None` if the error of its
    /// direction is large, or if origin or primitives are very far.
    ///
    /// The error sums of o' and of d, scaled like d, are e and κ |E|.
    #[inline(always)]
    pub fn approximate(ray: &ApproximateRay, around: &Bounds) -> Option<Self> {
        let far = max_distance(ray.origin, around);
        let (axis, most) = max_component(xyz(ray.direction));
        let inverse = inverse_power_of_two(most);
        let along = ray.direction * F32x4::splat(inverse);
        let norm = sum_xyz(along.abs());
        let total = |errors: F32x4| sum_xyz(errors) * (MARGIN * MARGIN) as f32;
        let direction_error = total(ray.direction_error) * inverse;
        let fits = far <= MAX_COORDINATE && direction_error <= 0.5 && most.is_normal();
        let absolute_error = norm * (total(ray.origin_error) + (TINY * MARGIN * MARGIN) as f32);
        let relative_error = direction_error + norm * (16.0 * UNIT) as f32;
        let error_bound = absolute_error + relative_error * far;
        let length = sum_xyz(along * along).sqrt() * (1.0 + 1.0 / 65_536.0) + direction_error;
        fits.then(|| Self {
            origin: xyz(ray.origin),
            direction: xyz(along),
            axis,
            absolute_error,
            relative_error,
            error_bound,
            behind_error_bound: f32::INFINITY,
            length,
            cone_terms: cone_terms(relative_error, error_bound, length),
        })
    }

    #[inline(always)]
    fn prepare(ray: &ObjectRay, around: &Bounds) -> (Self, Option<CullErrors>) {
        let (o, o_error) = ray.origin_bounded();
        let (d, d_error) = ray.direction_bounded();
        let size = around.min.iter().chain(&around.max).fold(0.0f32, |a, x| a.max(x.abs()));
        let size = f64::from(size);
        let far = o[0].abs().max(o[1].abs()).max(o[2].abs());
        let t0 = if far > 4.0 * size { t_near_bounds(o, d, around, size) } else { 0.0 };

        let (axis, most) = max_component(d);
        let inverse = 1.0 / most;
        let mut out = Self { axis, ..Self::EMPTY };
        const U: f64 = f64::EPSILON;
        // Bounds of each component, in f64 with twice the error that theory gives.
        let mut origin_error = [0.0; 3];
        let mut direction_error = [0.0; 3];
        let mut error_bound = size;
        for i in 0..3 {
            let moved = o[i] + t0 * d[i];
            out.origin[i] = moved as f32;
            let rounding = (moved - f64::from(out.origin[i])).abs();
            origin_error[i] = rounding + o_error[i];
            if t0 != 0.0 {
                origin_error[i] += t0 * d_error[i] + (moved.abs() + (t0 * d[i]).abs()) * (2.0 * U);
            }
            let along = d[i] * inverse;
            out.direction[i] = along as f32;
            let rounding = (along - f64::from(out.direction[i])).abs();
            direction_error[i] = rounding + (d_error[i] * inverse + along.abs() * (2.0 * U)) * MARGIN;
            error_bound = error_bound.max(moved.abs());
        }
        // Written so that a NaN is not within.
        if !(error_bound <= 1_152_921_504_606_846_976.0) || !(direction_error[axis] <= 0.5) {
            return (out, None);
        }
        let e = origin_error[0] + origin_error[1] + origin_error[2] + TINY;
        let norm = out.direction.iter().map(|x| f64::from(x.abs())).sum::<f64>();
        let kappa = direction_error[0] + direction_error[1] + direction_error[2];
        let square = out.direction.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>();
        out.absolute_error = (norm * e * MARGIN) as f32;
        out.relative_error = ((kappa + norm * (12.0 * UNIT)) * MARGIN) as f32;
        out.length = ((square.sqrt() + kappa) * MARGIN) as f32;
        out.error_bound = out.absolute_error + out.relative_error * max_distance(xyz0(out.origin), around);
        out.cone_terms = cone_terms(out.relative_error, out.error_bound, out.length);
        (out, Some(CullErrors { origin: origin_error, direction: direction_error, t0 }))
    }

    #[inline(always)]
    fn origins(&self) -> [F32x4; 3] {
        array::map(self.origin, F32x4::splat)
    }

    #[inline(always)]
    fn directions(&self) -> [F32x4; 3] {
        array::map(self.direction, F32x4::splat)
    }
}

/// Computes [`CullRay::cone`] from the other terms.
#[inline(always)]
fn cone_terms(relative_error: f32, error_bound: f32, length: f32) -> [f32; 3] {
    [5.5 * error_bound * length, 10.0 * relative_error * length, length * length]
}

/// 2^-60: see the head of this file.
const TINY: f64 = 1.0 / 1_152_921_504_606_846_976.0;

/// A t at which the ray is near a box but not yet in it; 0 if it starts there. Any t would be
/// correct.
#[cold]
fn t_near_bounds(o: [f64; 3], d: [f64; 3], around: &Bounds, size: f64) -> f64 {
    let square: f64 = d.iter().map(|x| x * x).sum();
    let along: f64 =
        (0..3).map(|i| (0.5 * (f64::from(around.min[i]) + f64::from(around.max[i])) - o[i]) * d[i]).sum();
    // The box lies within 2 sqrt 3 sizes of its middle; the rest covers roundings.
    let t = (along / square) * (1.0 - 1e-9) - 4.0 * size / square.sqrt();
    if t > 0.0 && t.is_finite() { t } else { 0.0 }
}

/// The axis of the component of greatest magnitude, and that magnitude.
#[inline(always)]
fn max_component<R: Real>(v: [R; 3]) -> (usize, R) {
    let [x, y, z] = array::map(v, R::abs);
    let (axis, most) = (usize::from(y > x), if y > x { y } else { x });
    (if z > most { 2 } else { axis }, if z > most { z } else { most })
}

/// The power of two that brings a normal number to a magnitude from 1 to 2.
#[inline(always)]
fn inverse_power_of_two(x: f32) -> f32 {
    const EXPONENT: u32 = 0xFF << 23;
    f32::from_bits((254 << 23) - (x.to_bits() & EXPONENT))
}

#[inline(always)]
fn xyz0([x, y, z]: [f32; 3]) -> F32x4 {
    F32x4::new([x, y, z, 0.0])
}

#[inline(always)]
fn xyz(v: F32x4) -> [f32; 3] {
    let [x, y, z, _] = v.to_array();
    [x, y, z]
}

/// The sum of the first three lanes.
#[inline(always)]
fn sum_xyz(v: F32x4) -> f32 {
    let [x, y, z, _] = v.to_array();
    x + y + z
}

/// An upper bound of the 1-norm of the vector from an origin to any point of a box. For a ball
/// within the box it bounds that to the centre plus the radius.
#[inline(always)]
fn max_distance(origin: F32x4, around: &Bounds) -> f32 {
    let (below, above) = (origin - xyz0(around.min), xyz0(around.max) - origin);
    sum_xyz(below.abs().relaxed_max(above.abs())) * MARGIN as f32
}

/// One number for each of four primitives.
type PerLane = [f32; LANES];

#[inline(always)]
fn load<const N: usize>(rows: &[PerLane; N]) -> [F32x4; N] {
    array::map(*rows, F32x4::new)
}

#[inline(always)]
fn sub(a: [F32x4; 3], b: [F32x4; 3]) -> [F32x4; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn norm1(a: [F32x4; 3]) -> F32x4 {
    a[0].abs() + a[1].abs() + a[2].abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::math::baseline_simd::BaselineSimd;

    const UNIT_BOX: Bounds = Bounds { min: [-1.0; 3], max: [1.0; 3] };

    /// Rays along z at a distance from the axis, near and far, and under a matrix with thirds in
    /// its inverse: equivalent for primitives around the origin.
    fn rays(x: f32) -> Vec<ObjectRay> {
        let near = Ray::new([x, 0.0, 4.0], [0.0, 0.0, -0.5]);
        let far = Ray::new([x, 0.0, 4096.0], [0.0, 0.0, -1e-20]);
        let thirds = [[3.0, 0.0, 0.0, 0.0], [0.0, 3.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0]];
        let placed = Ray::new([3.0 * x, 0.0, 12.0], [0.0, 0.0, -1.0]);
        [(near, None), (far, None), (placed, Some(&thirds))]
            .map(|(ray, matrix)| ObjectRay::new(&ray, matrix).unwrap())
            .into()
    }

    #[test]
    fn each_lane_is_dropped_by_its_own_primitive() {
        let mut spheres = Sphere4::EMPTY;
        let mut swept = LinearSweptSphere4::EMPTY;
        let mut triangles = Triangle4::EMPTY;
        let mut boxes = Aabb4::EMPTY;
        for lane in 0..LANES {
            // Of half-width (lane + 1) / 4 about the axis.
            let half = (lane + 1) as f32 / 4.0;
            spheres.set(lane, [0.0; 3], half);
            swept.set(lane, [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]], [half, half * 0.5]);
            triangles.set(lane, [[-half, -1.0, 0.0], [half, -1.0, 0.0], [half, 1.0, 0.0]]);
            boxes.set(lane, [-half; 3], [half; 3]);
        }
        // Between the half-widths, a thousandth outside of one and inside the next.
        for (x, kept) in [(0.1, 0b1111), (0.251, 0b1110), (0.501, 0b1100), (0.751, 0b1000), (1.001, 0)] {
            for ray in rays(x) {
                assert_eq!(boxes.maybe_hit_mask(&BoxRay::new(&ray, &UNIT_BOX)), kept, "{x} {ray:?}");
                let ray = CullRay::new(&ray, &UNIT_BOX);
                assert_eq!(spheres.maybe_hit_mask(BaselineSimd, &ray), kept, "{x} {ray:?}");
                assert_eq!(
                    triangles.maybe_hit_mask(BaselineSimd, &ShearedRay::of(&ray)),
                    kept,
                    "{x} {ray:?}"
                );
                // Its bound is looser: within 2 percent of the radius.
                assert_eq!(swept.maybe_hit_mask(BaselineSimd, &ray) & kept, kept, "{x} {ray:?}");
            }
            for ray in rays(x * 1.02) {
                let ray = CullRay::new(&ray, &UNIT_BOX);
                assert_eq!(swept.maybe_hit_mask(BaselineSimd, &ray), kept, "{x} {ray:?}");
            }
        }
    }

    #[test]
    fn spheres_that_are_entered_behind_the_origin_are_dropped_on_request() {
        let mut spheres = Sphere4::EMPTY;
        // Around the origin, ahead of it, behind it, and beside it with the centre a little ahead.
        for (lane, (x, z)) in [(0.0, 0.25), (0.0, -0.5), (0.0, 0.5), (0.25, -0.01)].into_iter().enumerate() {
            spheres.set(lane, [x, 0.0, z], 0.3);
        }
        let along = Ray::new([0.0; 3], [0.0, 0.0, -0.5]);
        // A negative t counts where the interval says so.
        for (ray, kept) in [(along, 0b1010), (along.with_interval(-9.0, 9.0), 0b1111)] {
            let ray = CullRay::new(&ObjectRay::new(&ray, None).unwrap(), &UNIT_BOX);
            assert_eq!(
                (spheres.maybe_hit_mask(BaselineSimd, &ray), spheres.maybe_entered_mask(BaselineSimd, &ray)),
                (0b1111, kept)
            );
        }
    }

    #[test]
    fn what_is_not_known_drops_nothing() {
        let mut spheres = Sphere4::EMPTY;
        spheres.set(0, [1.0; 3], 0.125);
        let still = Ray::new([0.0; 3], [0.0; 3]);
        let huge = Ray::new([3e38, 0.0, 0.0], [0.0, 3e38, 0.0]);
        for ray in [still, huge] {
            let ray =
                CullRay::new(&ObjectRay::new(&ray, None).unwrap(), &Bounds { min: [0.0; 3], max: [3e38; 3] });
            assert_eq!(spheres.maybe_hit_mask(BaselineSimd, &ray) & 1, 1);
        }
    }
}
