//! The f64 step for one triangle, its vectors' components side by side: the formulas of `triangle`,
//! with bounds made of few norms. A product that goes into a sum unrounded is off by less than they
//! allow.
//!
//! # Error
//! Let N be the 1-norm of the greater components of e1 and e2, so that |e1|, |e2| <= N. By the
//! table at `object_ray::BoundedRay` det is off by at most c |d| N^2, beta and gamma by |d| N
//! error_bound(|w|), and e2.q by N^2 error_bound(|w|). alpha is summed up with its components'
//! differences taken first: two roundings more in each of its three products, 9u of the 12u of c,
//! so that it is off by what the three are together. All are divided by det: [`Divisor4`] lane by
//! lane. With alpha / det, beta / det and gamma / det above 0 and t within the interval it is hit;
//! with one of the former below 0, or t outside, it is missed. It is also missed, whatever det is,
//! where two of alpha, beta and gamma have opposite signs. The bounds of the quotients are compared
//! after they were rounded to f32, as the numbers that they are compared with are f32: a bound that
//! is above or below such a number after rounding was so before. Equality decides nothing.
//!
//! # Branches
//! The result is made of the computed quotients, and the bounds only confirm it. As they nearly
//! always do, the branch is predicted well, and code that uses t does not wait for the bounds.

use crate::geometry::Intersection;
use crate::geometry::double_ray::DoubleRay;
use crate::geometry::intersection4::{ALL, Divisor4};
use crate::geometry::triangle::facing;
use crate::geometry::verdict::Verdict;
use crate::math::array;
use crate::math::f32x4::F32x4;
use crate::math::f64x4::F64x4Ops;

/// Tests one triangle in four lanes.
#[inline(always)]
pub(crate) fn intersect_simd<D: F64x4Ops>(
    simd: D,
    ray: &DoubleRay<D>,
    [v0, v1, v2]: [[f32; 3]; 3],
) -> Verdict<Intersection> {
    let DoubleRay { origin, direction: d, origin_error, relative_error, direction_norm, t_min, t_max } = *ray;
    let point = |[x, y, z]: [f32; 3]| simd.load_f32(&[x, y, z, 0.0]);
    let (v0, v1, v2) = (point(v0), point(v1), point(v2));
    let (e1, e2, w) = (simd.sub(v1, v0), simd.sub(v2, v0), simd.sub(origin, v0));

    // (x, y, z) and (y, z, x) make a vector product's (z, x, y).
    let yzx = |v| simd.yzx(v);
    let p = yzx(simd.mul_sub(d, yzx(e2), simd.mul(yzx(d), e2)));
    let q = yzx(simd.mul_sub(w, yzx(e1), simd.mul(yzx(w), e1)));
    let det_terms = simd.mul(e1, p);
    let beta_terms = simd.mul(w, p);
    let gamma_terms = simd.mul(d, q);
    let t_terms = simd.mul(e2, q);
    let det = simd.reduce_sum(det_terms);
    let alpha_terms = simd.sub(simd.sub(det_terms, beta_terms), gamma_terms);
    let numerators = simd.reduce_sums([t_terms, beta_terms, gamma_terms, alpha_terms]);

    let n = simd.reduce_sum(simd.relaxed_max(simd.abs(e1), simd.abs(e2)));
    let error_bound = simd.mul_add(relative_error, simd.reduce_sum(simd.abs(w)), origin_error);
    let e_det = simd.mul(simd.mul(n, n), simd.mul(relative_error, direction_norm));
    let lanes = |lanes: [f32; 4]| simd.load_f32(&lanes);
    // The weights are N for e2.q, |d| for beta and gamma, 2 |d| for alpha; N times the error bound
    // of w multiplies them.
    let weights =
        simd.mul_add(direction_norm, lanes([0.0, 1.0, 1.0, 2.0]), simd.mul(n, lanes([1.0, 0.0, 0.0, 0.0])));
    let errors =
        simd.mul_add(simd.mul(n, error_bound), weights, simd.mul(e_det, lanes([0.0, 0.0, 0.0, 1.0])));
    let divisor = Divisor4::new(simd, det, e_det);
    let quotients = divisor.quotient(numerators, errors);
    let [first, last] = quotients.rounded_bounds(simd);

    let least = F32x4::new([t_min, 0.0, 0.0, 0.0]);
    let greatest = F32x4::new([t_max, f32::MAX, f32::MAX, f32::MAX]);
    if divisor.is_certain != 0 {
        let known = first.cmp_ge(last) | ALPHA_LANE;
        if first.cmp_gt(least) & greatest.cmp_gt(last) & known == ALL {
            let [t, b1, b2, _] = quotients.rounded_value(simd).to_array();
            let surface = facing(simd.cmp_gt(det, simd.splat(0.0)) != 0);
            return Verdict::Hit(Intersection { t, attributes: [b1, b2], surface });
        }
        if least.cmp_gt(last) | first.cmp_gt(greatest) != 0 {
            return Verdict::Miss;
        }
    }
    let negative = simd.cmp_gt(simd.sub(simd.splat(0.0), errors), numerators);
    let positive = simd.cmp_gt(numerators, errors);
    let signs = array::map([negative, positive], |signs| signs & !T_LANE);
    if signs[0] != 0 && signs[1] != 0 { Verdict::Miss } else { Verdict::Undecided }
}

/// The lane of alpha, of which only the sign must be known.
const ALPHA_LANE: u32 = 0b1000;
/// The lane of t.
const T_LANE: u32 = 0b0001;
