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
    let direction = [doubles.all(x), doubles.all(y), doubles.all(z)];
    let [x, y, z] = ray.origin;
    let origin = [doubles.all(x), doubles.all(y), doubles.all(z)];
    let center = [doubles.floats(&center[0]), doubles.floats(&center[1]), doubles.floats(&center[2])];
    let radius = doubles.floats(radius);

    let w = doubles.vector_difference(origin, center);
    let back = doubles.product(doubles.dot(direction, w), doubles.all(inverse));
    let way = doubles.product(doubles.magnitude(back), doubles.all(ray.direction_norm));
    let offset = [
        doubles.product_from(back, direction[0], w[0]),
        doubles.product_from(back, direction[1], w[1]),
        doubles.product_from(back, direction[2], w[2]),
    ];
    let reach = doubles.product_and(doubles.all(growing), doubles.sum(radius, way), doubles.all(fixed));
    let square = doubles.dot(offset, offset);

    let near = doubles.sum(radius, reach);
    let beside = doubles.product(square, doubles.all(1.0 - 3.0 * growing));
    let missed = doubles.is_above(beside, doubles.product(near, near));
    if missed == ALL {
        return FourTested::MISSED;
    }
    let room = doubles.product_less(radius, radius, square);
    let sure = doubles.product_and(doubles.all(16.0), reach, doubles.product(doubles.all(0.125), radius));
    let entered =
        doubles.is_at_least(room, doubles.product(sure, sure)) & doubles.is_above(radius, doubles.all(0.0));
    let mut out = FourTested { undecided: ALL & !(missed | entered), ..FourTested::MISSED };
    if entered == 0 {
        return out;
    }

    let half = doubles.root(doubles.product(room, doubles.all(inverse)));
    let t = doubles.difference(doubles.difference(doubles.all(0.0), back), half);
    let error = doubles.product(doubles.all(16.0 * slowness), reach);
    let t = Ends::around(doubles, t, error);
    let (t_min, t_max) = (doubles.all(t_min), doubles.all(t_max));
    let within = doubles.is_at_least(t.below, t_min) & doubles.is_at_least(t_max, t.above);
    let outside = doubles.is_above(t_min, t.above) | doubles.is_above(t.below, t_max);
    let (known, rounded) = t.rounded(doubles);
    let beyond = within & known & rounded.above(Four::splat(limit));
    out.hits = entered & within & known & !beyond;
    out.undecided |= entered & !(outside | out.hits | beyond);
    out.t = rounded.to_array();
    out
}
