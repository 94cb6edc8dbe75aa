//! The f64 step for one triangle, its vectors' components side by side: the formulas of `triangle`,
//! with bounds made of few norms. A product that goes into a sum unrounded is off by less than they
//! allow.
//!
//! # Error
//! Let N be the 1-norm of the greater components of e1 and e2, so that |e1|, |e2| <= N. By the
//! table at `object_ray::View` det is off by at most c |d| N^2, beta and gamma by |d| N reach(|w|),
//! and e2.q by N^2 reach(|w|). alpha is summed up with its components' differences taken first: two
//! roundings more in each of its three products, 9u of the 12u of c, so that it is off by what the
//! three are together. All are divided by det: [`Divisor4`] lane by lane. With alpha / det, beta /
//! det and gamma / det above 0 and t within the interval it is hit; with one of the former below 0,
//! or t outside, missed, and so it is, whatever det is, where two of alpha, beta and gamma have
//! opposite signs. The ends of what the quotients may be are compared after they were rounded to
//! f32, as what they are compared with is of f32: one above it or below it after that was so
//! before. Equal ones tell nothing.
//!
//! # Branches
//! What is returned is made of the quotients as they are, and the bounds only say that it holds: as
//! that is nearly always so, the branch is predicted, and code that takes the t waits for no bound.

use crate::geometry::Intersection;
use crate::geometry::intersection4::{ALL, Divisor4};
use crate::geometry::object_ray::DoubleRay;
use crate::geometry::triangle::facing;
use crate::geometry::verdict::Verdict;
use crate::math::f32x4::F32x4;
use crate::math::f64x4::F64x4Ops;

/// Tests one triangle in four lanes.
#[inline(always)]
pub fn intersect_simd<D: F64x4Ops>(
    simd: D,
    ray: &DoubleRay<D>,
    [v0, v1, v2]: [[f32; 3]; 3],
) -> Verdict<Intersection> {
    let DoubleRay { origin, direction: d, origin_error, slack, direction_norm, t_min, t_max } = *ray;
    let point = |[x, y, z]: [f32; 3]| simd.load_f32(&[x, y, z, 0.0]);
    let (v0, v1, v2) = (point(v0), point(v1), point(v2));
    let (e1, e2, w) = (simd.sub(v1, v0), simd.sub(v2, v0), simd.sub(origin, v0));

    // (x, y, z) and (y, z, x) make a vector product's (z, x, y).
    let turned = |v| simd.yzx(v);
    let p = turned(simd.mul_sub(d, turned(e2), simd.mul(turned(d), e2)));
    let q = turned(simd.mul_sub(w, turned(e1), simd.mul(turned(w), e1)));
    let of_det = simd.mul(e1, p);
    let of_beta = simd.mul(w, p);
    let of_gamma = simd.mul(d, q);
    let of_t = simd.mul(e2, q);
    let det = simd.reduce_sum(of_det);
    let of_alpha = simd.sub(simd.sub(of_det, of_beta), of_gamma);
    let numerators = simd.reduce_sums([of_t, of_beta, of_gamma, of_alpha]);

    let n = simd.reduce_sum(simd.relaxed_max(simd.abs(e1), simd.abs(e2)));
    let error_bound = simd.mul_add(slack, simd.reduce_sum(simd.abs(w)), origin_error);
    let e_det = simd.mul(simd.mul(n, n), simd.mul(slack, direction_norm));
    let few = |lanes: [f32; 4]| simd.load_f32(&lanes);
    // Of e2.q N, of beta and gamma |d|, of alpha 2 |d|: times N reach.
    let weights =
        simd.mul_add(direction_norm, few([0.0, 1.0, 1.0, 2.0]), simd.mul(n, few([1.0, 0.0, 0.0, 0.0])));
    let errors = simd.mul_add(simd.mul(n, error_bound), weights, simd.mul(e_det, few([0.0, 0.0, 0.0, 1.0])));
    let divisor = Divisor4::new(simd, det, e_det);
    let quotients = divisor.quotient(numerators, errors);
    let [first, last] = quotients.rounded_ends(simd);

    let least = F32x4::new([t_min, 0.0, 0.0, 0.0]);
    let greatest = F32x4::new([t_max, f32::MAX, f32::MAX, f32::MAX]);
    if divisor.is_certain != 0 {
        let known = first.cmp_ge(last) | OF_ALPHA;
        if first.cmp_gt(least) & greatest.cmp_gt(last) & known == ALL {
            let [t, b1, b2, _] = quotients.rounded_middle(simd).to_array();
            let surface = facing(simd.cmp_gt(det, simd.splat(0.0)) != 0);
            return Verdict::Hit(Intersection { t, attributes: [b1, b2], surface });
        }
        if least.cmp_gt(last) | first.cmp_gt(greatest) != 0 {
            return Verdict::Miss;
        }
    }
    let negative = simd.cmp_gt(simd.sub(simd.splat(0.0), errors), numerators);
    let positive = simd.cmp_gt(numerators, errors);
    let signs = [negative, positive].map(|signs| signs & !OF_T);
    if signs[0] != 0 && signs[1] != 0 { Verdict::Miss } else { Verdict::Undecided }
}

/// The lane of alpha, which need not be known but for its sign.
const OF_ALPHA: u32 = 0b1000;
/// The lane of t.
const OF_T: u32 = 0b0001;
