//! The f64 step for the four triangles of a block at once: the formulas and bounds of `triangle`,
//! lane by lane. A product that goes into a sum unrounded is off by less than the bounds allow.

use crate::geometry::Surface;
use crate::geometry::double_ray::DoubleRay;
use crate::geometry::intersection4::{ALL, Divisor4, Intersection4};
use crate::math::error_bound::two_units;
use crate::math::f32x4::F32x4;
use crate::math::f64x4::F64x4Ops;

/// All four are missed.
const MISSED: Intersection4 =
    Intersection4 { surfaces: [Surface::TriangleBack, Surface::TriangleFront], ..Intersection4::MISSED };

/// Tests four triangles in SoA form; hits behind `limit`, a rounded t, may be left out. The results
/// of lanes without a triangle have no meaning.
#[inline(always)]
pub(crate) fn intersect4<D: F64x4Ops>(
    simd: D,
    ray: &DoubleRay<D>,
    vertices: &[[[f32; 4]; 3]; 3],
    limit: f32,
) -> Intersection4 {
    let DoubleRay { origin, direction, origin_error, relative_error, direction_norm, t_min, t_max } = *ray;
    let (v0, v1, v2) = (point(simd, &vertices[0]), point(simd, &vertices[1]), point(simd, &vertices[2]));
    let d = simd.splat_xyz(direction);
    let (e1, e2) = (simd.sub3(v1, v0), simd.sub3(v2, v0));
    let w = simd.sub3(simd.splat_xyz(origin), v0);
    let (e1n, e2n) = (simd.norm1(e1), simd.norm1(e2));
    let error_bound = simd.mul_add(relative_error, simd.norm1(w), origin_error);
    let de1 = simd.mul(direction_norm, e1n);
    let de2 = simd.mul(direction_norm, e2n);

    let p = simd.cross3(d, e2);
    let q = simd.cross3(w, e1);
    let det = simd.dot3(e1, p);
    let e_det = simd.mul(relative_error, simd.mul(e1n, de2));
    let beta = simd.dot3(w, p);
    let e_beta = simd.mul(de2, error_bound);
    let gamma = simd.dot3(d, q);
    let e_gamma = simd.mul(de1, error_bound);
    let alpha = simd.sub(simd.sub(det, beta), gamma);
    let sizes = simd.norm1([det, beta, gamma]);
    let errors = simd.add(simd.add(e_det, e_beta), e_gamma);
    let rounding = two_units::<f64>() + two_units::<f64>();
    let e_alpha = simd.mul_add(simd.splat(rounding), sizes, errors);

    let alpha_signs = Signs::of(simd, alpha, e_alpha);
    let beta_signs = Signs::of(simd, beta, e_beta);
    let gamma_signs = Signs::of(simd, gamma, e_gamma);
    let some_negative = alpha_signs.negative | beta_signs.negative | gamma_signs.negative;
    let some_positive = alpha_signs.positive | beta_signs.positive | gamma_signs.positive;
    let missed = some_negative & some_positive;
    if missed == ALL {
        return MISSED;
    }
    let det_signs = Signs::of(simd, det, e_det);
    let inside = alpha_signs.certain() & beta_signs.certain() & gamma_signs.certain() & det_signs.certain();
    let mut out =
        Intersection4 { undecided: ALL & !(missed | inside), second_surface: det_signs.positive, ..MISSED };
    let inside = inside & !missed;
    if inside == 0 {
        return out;
    }

    let divisor = Divisor4::new(simd, det, e_det);
    let t = divisor.quotient(simd.dot3(e2, q), simd.mul(simd.mul(e1n, e2n), error_bound));
    let (t_min, t_max) = (simd.splat(t_min.into()), simd.splat(t_max.into()));
    let outside = simd.cmp_ge(t_min, t.high) | simd.cmp_ge(t.low, t_max);
    let within = simd.cmp_gt(t.low, t_min) & simd.cmp_gt(t_max, t.high);
    let (known, rounded) = t.rounded(simd);
    // A t that rounds to infinity is no hit.
    let beyond = known & (rounded.cmp_gt(F32x4::splat(limit)) | rounded.abs().cmp_gt(F32x4::splat(f32::MAX)));
    let left = inside & !(outside | within & beyond);
    let decided = left & within & known & divisor.is_certain;
    out.undecided |= left & !decided;
    if decided == 0 {
        return out;
    }
    let (known_1, first) = divisor.quotient(beta, e_beta).rounded(simd);
    let (known_2, second) = divisor.quotient(gamma, e_gamma).rounded(simd);
    out.hits = decided & known_1 & known_2;
    out.undecided |= decided & !out.hits;
    (out.t, out.attributes) = (rounded.to_array(), [first.to_array(), second.to_array()]);
    out
}

#[inline(always)]
fn point<D: F64x4Ops>(simd: D, rows: &[[f32; 4]; 3]) -> [D::F64x4; 3] {
    [simd.load_f32(&rows[0]), simd.load_f32(&rows[1]), simd.load_f32(&rows[2])]
}

/// A mask of the lanes whose number certainly has the given sign.
#[derive(Clone, Copy)]
struct Signs {
    negative: u32,
    positive: u32,
}

impl Signs {
    #[inline(always)]
    fn of<D: F64x4Ops>(simd: D, value: D::F64x4, error: D::F64x4) -> Self {
        let below = simd.sub(simd.splat(0.0), error);
        Self { negative: simd.cmp_gt(below, value), positive: simd.cmp_gt(value, error) }
    }

    #[inline(always)]
    fn certain(self) -> u32 {
        self.negative | self.positive
    }
}
