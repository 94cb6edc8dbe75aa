//! The f64 step for the four triangles of a block at once: the formulas and bounds of `triangle`, lane by
//! lane. A product that goes into a sum unrounded is off by less than the bounds allow.

use crate::geometry::Surface;
use crate::geometry::four_tested::{ALL, Divisor, FourTested};
use crate::geometry::object_ray::DoubleRay;
use crate::math::doubles::Doubles;
use crate::math::error_bound::two_units;
use crate::math::four::Four;

/// All are missed.
const MISSED: FourTested =
    FourTested { surfaces: [Surface::TriangleBack, Surface::TriangleFront], ..FourTested::MISSED };

/// Tests the triangles whose vertices stand in rows; what lies behind `limit`, a rounded t, may be
/// left out. Lanes without a triangle mean nothing.
#[inline(always)]
pub fn tested<D: Doubles>(
    doubles: D,
    ray: &DoubleRay<D>,
    vertices: &[[[f32; 4]; 3]; 3],
    limit: f32,
) -> FourTested {
    let DoubleRay { origin, direction, origin_error, slack, direction_norm, t_min, t_max } = *ray;
    let (v0, v1, v2) =
        (point(doubles, &vertices[0]), point(doubles, &vertices[1]), point(doubles, &vertices[2]));
    let d = doubles.spread(direction);
    let (e1, e2) = (doubles.vector_difference(v1, v0), doubles.vector_difference(v2, v0));
    let w = doubles.vector_difference(doubles.spread(origin), v0);
    let (e1n, e2n) = (doubles.norm1(e1), doubles.norm1(e2));
    let reach = doubles.product_and(slack, doubles.norm1(w), origin_error);
    let de1 = doubles.product(direction_norm, e1n);
    let de2 = doubles.product(direction_norm, e2n);

    let p = doubles.cross(d, e2);
    let q = doubles.cross(w, e1);
    let det = doubles.dot(e1, p);
    let e_det = doubles.product(slack, doubles.product(e1n, de2));
    let beta = doubles.dot(w, p);
    let e_beta = doubles.product(de2, reach);
    let gamma = doubles.dot(d, q);
    let e_gamma = doubles.product(de1, reach);
    let alpha = doubles.difference(doubles.difference(det, beta), gamma);
    let sizes = doubles.norm1([det, beta, gamma]);
    let errors = doubles.sum(doubles.sum(e_det, e_beta), e_gamma);
    let rounding = two_units::<f64>() + two_units::<f64>();
    let e_alpha = doubles.product_and(doubles.all(rounding), sizes, errors);

    let of_alpha = Signs::of(doubles, alpha, e_alpha);
    let of_beta = Signs::of(doubles, beta, e_beta);
    let of_gamma = Signs::of(doubles, gamma, e_gamma);
    let some_negative = of_alpha.negative | of_beta.negative | of_gamma.negative;
    let some_positive = of_alpha.positive | of_beta.positive | of_gamma.positive;
    let missed = some_negative & some_positive;
    if missed == ALL {
        return MISSED;
    }
    let of_det = Signs::of(doubles, det, e_det);
    let inside = of_alpha.certain() & of_beta.certain() & of_gamma.certain() & of_det.certain();
    let mut out = FourTested { undecided: ALL & !(missed | inside), marked: of_det.positive, ..MISSED };
    let inside = inside & !missed;
    if inside == 0 {
        return out;
    }

    let divisor = Divisor::new(doubles, det, e_det);
    let t = divisor.quotient(doubles.dot(e2, q), doubles.product(doubles.product(e1n, e2n), reach));
    let (t_min, t_max) = (doubles.all(t_min.into()), doubles.all(t_max.into()));
    let outside = doubles.is_at_least(t_min, t.above) | doubles.is_at_least(t.below, t_max);
    let within = doubles.is_above(t.below, t_min) & doubles.is_above(t_max, t.above);
    let (known, rounded) = t.rounded(doubles);
    // A t that rounds to infinity is none.
    let beyond = known & (rounded.above(Four::splat(limit)) | rounded.abs().above(Four::splat(f32::MAX)));
    let left = inside & !(outside | within & beyond);
    let decided = left & within & known & divisor.is_certain;
    out.undecided |= left & !decided;
    if decided == 0 {
        return out;
    }
    let (known_1, first) = divisor.quotient(beta, e_beta).rounded(doubles);
    let (known_2, second) = divisor.quotient(gamma, e_gamma).rounded(doubles);
    out.hits = decided & known_1 & known_2;
    out.undecided |= decided & !out.hits;
    (out.t, out.attributes) = (rounded.to_array(), [first.to_array(), second.to_array()]);
    out
}

#[inline(always)]
fn point<D: Doubles>(doubles: D, rows: &[[f32; 4]; 3]) -> [D::Four; 3] {
    [doubles.floats(&rows[0]), doubles.floats(&rows[1]), doubles.floats(&rows[2])]
}

/// A bit for each lane whose number surely has that sign.
#[derive(Clone, Copy)]
struct Signs {
    negative: u32,
    positive: u32,
}

impl Signs {
    #[inline(always)]
    fn of<D: Doubles>(doubles: D, value: D::Four, error: D::Four) -> Self {
        let below = doubles.difference(doubles.all(0.0), error);
        Self { negative: doubles.is_above(below, value), positive: doubles.is_above(value, error) }
    }

    #[inline(always)]
    fn certain(self) -> u32 {
        self.negative | self.positive
    }
}
