//! The f64 filter from the closest approach for the four spheres of a block at once: the formulas
//! and bounds of `geometry::closest_approach`, lane by lane. A product that goes into a sum
//! unrounded is off by less than those allow.

use crate::geometry::approach_terms::ClosestApproachTerms;
use crate::geometry::intersection4::{ALL, Intersection4, Interval4};
use crate::geometry::object_ray::ObjectRay;
use crate::math::f32x4::F32x4;
use crate::math::f64x4::F64x4Ops;

/// Tests four spheres in SoA form; hits behind `limit`, a rounded t, may be left out. The results
/// of lanes without a sphere have no meaning.
#[inline(always)]
pub(crate) fn intersect4<D: F64x4Ops>(
    simd: D,
    ray: &ObjectRay,
    center: &[[f32; 4]; 3],
    radius: &[f32; 4],
    limit: f32,
) -> Intersection4 {
    let ClosestApproachTerms {
        inverse,
        inv_length,
        relative_error,
        absolute_error,
        interval: (t_min, t_max),
    } = ray.approach_terms;
    let [x, y, z] = ray.direction;
    let direction = [simd.splat(x), simd.splat(y), simd.splat(z)];
    let [x, y, z] = ray.origin;
    let origin = [simd.splat(x), simd.splat(y), simd.splat(z)];
    let center = [simd.load_f32(&center[0]), simd.load_f32(&center[1]), simd.load_f32(&center[2])];
    let radius = simd.load_f32(radius);

    let w = simd.sub3(origin, center);
    let sigma = simd.mul(simd.dot3(direction, w), simd.splat(inverse));
    let travel = simd.mul(simd.abs(sigma), simd.splat(ray.direction_norm));
    let offset = [
        simd.neg_mul_add(sigma, direction[0], w[0]),
        simd.neg_mul_add(sigma, direction[1], w[1]),
        simd.neg_mul_add(sigma, direction[2], w[2]),
    ];
    let error_bound =
        simd.mul_add(simd.splat(relative_error), simd.add(radius, travel), simd.splat(absolute_error));
    let square = simd.dot3(offset, offset);

    let outer = simd.add(radius, error_bound);
    let beside = simd.mul(square, simd.splat(1.0 - 3.0 * relative_error));
    let missed = simd.cmp_gt(beside, simd.mul(outer, outer));
    if missed == ALL {
        return Intersection4::MISSED;
    }
    let half_chord2 = simd.mul_sub(radius, radius, square);
    let threshold = simd.mul_add(simd.splat(16.0), error_bound, simd.mul(simd.splat(0.125), radius));
    let entered =
        simd.cmp_ge(half_chord2, simd.mul(threshold, threshold)) & simd.cmp_gt(radius, simd.splat(0.0));
    let mut out = Intersection4 { undecided: ALL & !(missed | entered), ..Intersection4::MISSED };
    if entered == 0 {
        return out;
    }

    let half_chord = simd.sqrt(simd.mul(half_chord2, simd.splat(inverse)));
    let t = simd.sub(simd.sub(simd.splat(0.0), sigma), half_chord);
    let error = simd.mul(simd.splat(16.0 * inv_length), error_bound);
    let t = Interval4::new(simd, t, error);
    let (t_min, t_max) = (simd.splat(t_min), simd.splat(t_max));
    let within = simd.cmp_ge(t.low, t_min) & simd.cmp_ge(t_max, t.high);
    let outside = simd.cmp_gt(t_min, t.high) | simd.cmp_gt(t.low, t_max);
    let (known, rounded) = t.rounded(simd);
    let beyond = within & known & rounded.cmp_gt(F32x4::splat(limit));
    out.hits = entered & within & known & !beyond;
    out.undecided |= entered & !(outside | out.hits | beyond);
    out.t = rounded.to_array();
    out
}
