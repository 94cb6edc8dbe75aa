//! The step from the foot for the four spheres of a block at once: the formulas and bounds of
//! `geometry::foot`, lane by lane. A product that goes into a sum unrounded is off by less than those allow.

use crate::geometry::foot::Footing;
use crate::geometry::intersection4::{ALL, Ends, Intersection4};
use crate::geometry::object_ray::ObjectRay;
use crate::math::f32x4::F32x4;
use crate::math::f64x4::F64x4Ops;

/// Tests the spheres whose centres and radii stand in rows; what lies behind `limit`, a rounded t, may be
/// left out. Lanes without a sphere mean nothing.
#[inline(always)]
pub fn intersect4<D: F64x4Ops>(
    simd: D,
    ray: &ObjectRay,
    (center, radius): (&[[f32; 4]; 3], &[f32; 4]),
    limit: f32,
) -> Intersection4 {
    let Footing { inverse, slowness, growing, fixed, interval: (t_min, t_max) } = ray.footing;
    let [x, y, z] = ray.direction;
    let direction = [simd.splat(x), simd.splat(y), simd.splat(z)];
    let [x, y, z] = ray.origin;
    let origin = [simd.splat(x), simd.splat(y), simd.splat(z)];
    let center = [simd.from_f32(&center[0]), simd.from_f32(&center[1]), simd.from_f32(&center[2])];
    let radius = simd.from_f32(radius);

    let w = simd.sub3(origin, center);
    let back = simd.mul(simd.dot3(direction, w), simd.splat(inverse));
    let way = simd.mul(simd.abs(back), simd.splat(ray.direction_norm));
    let offset = [
        simd.neg_mul_add(back, direction[0], w[0]),
        simd.neg_mul_add(back, direction[1], w[1]),
        simd.neg_mul_add(back, direction[2], w[2]),
    ];
    let reach = simd.mul_add(simd.splat(growing), simd.add(radius, way), simd.splat(fixed));
    let square = simd.dot3(offset, offset);

    let near = simd.add(radius, reach);
    let beside = simd.mul(square, simd.splat(1.0 - 3.0 * growing));
    let missed = simd.cmp_gt(beside, simd.mul(near, near));
    if missed == ALL {
        return Intersection4::MISSED;
    }
    let room = simd.mul_sub(radius, radius, square);
    let sure = simd.mul_add(simd.splat(16.0), reach, simd.mul(simd.splat(0.125), radius));
    let entered = simd.cmp_ge(room, simd.mul(sure, sure)) & simd.cmp_gt(radius, simd.splat(0.0));
    let mut out = Intersection4 { undecided: ALL & !(missed | entered), ..Intersection4::MISSED };
    if entered == 0 {
        return out;
    }

    let half = simd.sqrt(simd.mul(room, simd.splat(inverse)));
    let t = simd.sub(simd.sub(simd.splat(0.0), back), half);
    let error = simd.mul(simd.splat(16.0 * slowness), reach);
    let t = Ends::around(simd, t, error);
    let (t_min, t_max) = (simd.splat(t_min), simd.splat(t_max));
    let within = simd.cmp_ge(t.below, t_min) & simd.cmp_ge(t_max, t.above);
    let outside = simd.cmp_gt(t_min, t.above) | simd.cmp_gt(t.below, t_max);
    let (known, rounded) = t.rounded(simd);
    let beyond = within & known & rounded.cmp_gt(F32x4::splat(limit));
    out.hits = entered & within & known & !beyond;
    out.undecided |= entered & !(outside | out.hits | beyond);
    out.t = rounded.to_array();
    out
}
