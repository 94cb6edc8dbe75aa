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
    let d = doubles.splat_xyz(direction);
    let (e1, e2) = (doubles.sub3(v1, v0), doubles.sub3(v2, v0));
    let w = doubles.sub3(doubles.splat_xyz(origin), v0);
    let (e1n, e2n) = (doubles.norm1(e1), doubles.norm1(e2));
    let reach = doubles.mul_add(slack, doubles.norm1(w), origin_error);
    let de1 = doubles.mul(direction_norm, e1n);
    let de2 = doubles.mul(direction_norm, e2n);

    let p = doubles.cross3(d, e2);
    let q = doubles.cross3(w, e1);
    let det = doubles.dot3(e1, p);
    let e_det = doubles.mul(slack, doubles.mul(e1n, de2));
    let beta = doubles.dot3(w, p);
    let e_beta = doubles.mul(de2, reach);
    let gamma = doubles.dot3(d, q);
    let e_gamma = doubles.mul(de1, reach);
    let alpha = doubles.sub(doubles.sub(det, beta), gamma);
    let sizes = doubles.norm1([det, beta, gamma]);
    let errors = doubles.add(doubles.add(e_det, e_beta), e_gamma);
    let rounding = two_units::<f64>() + two_units::<f64>();
    let e_alpha = doubles.mul_add(doubles.splat(rounding), sizes, errors);

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
    let t = divisor.quotient(doubles.dot3(e2, q), doubles.mul(doubles.mul(e1n, e2n), reach));
    let (t_min, t_max) = (doubles.splat(t_min.into()), doubles.splat(t_max.into()));
    let outside = doubles.cmp_ge(t_min, t.above) | doubles.cmp_ge(t.below, t_max);
    let within = doubles.cmp_gt(t.below, t_min) & doubles.cmp_gt(t_max, t.above);
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
fn point<D: Doubles>(doubles: D, rows: &[[f32; 4]; 3]) -> [D::F64x4; 3] {
    [doubles.from_f32(&rows[0]), doubles.from_f32(&rows[1]), doubles.from_f32(&rows[2])]
}

/// A bit for each lane whose number surely has that sign.
#[derive(Clone, Copy)]
struct Signs {
    negative: u32,
    positive: u32,
}

impl Signs {
    #[inline(always)]
    fn of<D: Doubles>(doubles: D, value: D::F64x4, error: D::F64x4) -> Self {
        let below = doubles.sub(doubles.splat(0.0), error);
        Self { negative: doubles.cmp_gt(below, value), positive: doubles.cmp_gt(value, error) }
    }

    #[inline(always)]
    fn certain(self) -> u32 {
        self.negative | self.positive
    }
}
