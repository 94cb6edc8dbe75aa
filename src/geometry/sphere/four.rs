//! The step from the foot for the four spheres of a block at once: the formulas and bounds of
//! `geometry::foot`, lane by lane. A product that goes into a sum unrounded is off by less than those allow.

use crate::geometry::foot::Footing;
use crate::geometry::four_tested::{ALL, Ends, FourTested};
use crate::geometry::object_ray::ObjectRay;
use crate::math::doubles::Doubles;
use crate::math::four::Four;

/// Tests the spheres whose centres and radii stand in rows; what lies behind `limit`, a rounded t, may be
/// left out. Lanes without a sphere mean nothing.
#[inline(always)]
pub fn tested<D: Doubles>(
    doubles: D,
    ray: &ObjectRay,
    (center, radius): (&[[f32; 4]; 3], &[f32; 4]),
    limit: f32,
) -> FourTested {
    let Footing { inverse, slowness, growing, fixed, interval: (t_min, t_max) } = ray.footing;
    let [x, y, z] = ray.direction;
    let direction = [doubles.splat(x), doubles.splat(y), doubles.splat(z)];
    let [x, y, z] = ray.origin;
    let origin = [doubles.splat(x), doubles.splat(y), doubles.splat(z)];
    let center = [doubles.from_f32(&center[0]), doubles.from_f32(&center[1]), doubles.from_f32(&center[2])];
    let radius = doubles.from_f32(radius);

    let w = doubles.sub3(origin, center);
    let back = doubles.mul(doubles.dot3(direction, w), doubles.splat(inverse));
    let way = doubles.mul(doubles.abs(back), doubles.splat(ray.direction_norm));
    let offset = [
        doubles.neg_mul_add(back, direction[0], w[0]),
        doubles.neg_mul_add(back, direction[1], w[1]),
        doubles.neg_mul_add(back, direction[2], w[2]),
    ];
    let reach = doubles.mul_add(doubles.splat(growing), doubles.add(radius, way), doubles.splat(fixed));
    let square = doubles.dot3(offset, offset);

    let near = doubles.add(radius, reach);
    let beside = doubles.mul(square, doubles.splat(1.0 - 3.0 * growing));
    let missed = doubles.cmp_gt(beside, doubles.mul(near, near));
    if missed == ALL {
        return FourTested::MISSED;
    }
    let room = doubles.mul_sub(radius, radius, square);
    let sure = doubles.mul_add(doubles.splat(16.0), reach, doubles.mul(doubles.splat(0.125), radius));
    let entered =
        doubles.cmp_ge(room, doubles.mul(sure, sure)) & doubles.cmp_gt(radius, doubles.splat(0.0));
    let mut out = FourTested { undecided: ALL & !(missed | entered), ..FourTested::MISSED };
    if entered == 0 {
        return out;
    }

    let half = doubles.sqrt(doubles.mul(room, doubles.splat(inverse)));
    let t = doubles.sub(doubles.sub(doubles.splat(0.0), back), half);
    let error = doubles.mul(doubles.splat(16.0 * slowness), reach);
    let t = Ends::around(doubles, t, error);
    let (t_min, t_max) = (doubles.splat(t_min), doubles.splat(t_max));
    let within = doubles.cmp_ge(t.below, t_min) & doubles.cmp_ge(t_max, t.above);
    let outside = doubles.cmp_gt(t_min, t.above) | doubles.cmp_gt(t.below, t_max);
    let (known, rounded) = t.rounded(doubles);
    let beyond = within & known & rounded.above(Four::splat(limit));
    out.hits = entered & within & known & !beyond;
    out.undecided |= entered & !(outside | out.hits | beyond);
    out.t = rounded.to_array();
    out
}
