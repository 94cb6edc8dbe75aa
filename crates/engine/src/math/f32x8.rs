//! Eight `f32` lanes of SIMD: two SSE2 or NEON registers, or one AVX register if the CPU has them.
//!
//! The operations are IEEE operations on single lanes, as in `math::f32x4`: the results are the
//! same bits on every instruction set.

#[cfg(target_arch = "x86_64")]
use pulp::f32x8;
#[cfg(target_arch = "x86_64")]
use pulp::x86::V3;

use crate::math::array;
use crate::math::baseline_simd::BaselineSimd;
use crate::math::f32x4::F32x4;
use crate::math::float;

/// Operations on eight `f32` lanes.
pub trait F32x8Ops: Copy {
    /// Eight lanes.
    type F32x8: Copy;

    /// Loads eight lanes.
    fn load(self, values: &[f32; 8]) -> Self::F32x8;
    /// One value in all lanes.
    fn splat(self, value: f32) -> Self::F32x8;
    /// The lanes as an array.
    fn to_array(self, value: Self::F32x8) -> [f32; 8];
    /// `a - b` in each lane.
    fn sub(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// `a b` in each lane.
    fn mul(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// `a + b` in each lane.
    fn add(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// `a / b` in each lane.
    fn div(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// The absolute value of each lane.
    fn abs(self, a: Self::F32x8) -> Self::F32x8;
    /// 1 or -1 by the sign bit of each lane.
    fn signum(self, a: Self::F32x8) -> Self::F32x8;
    /// The maximum of each lane; `b` if one of the two is a NaN.
    fn max(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// The minimum of each lane; `b` if one of the two is a NaN.
    fn min(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// A mask of the lanes in which `a >= b`.
    fn cmp_ge(self, a: Self::F32x8, b: Self::F32x8) -> u32;
    /// Truncates each lane to an integer; saturates, and gives 0 for a NaN.
    fn to_i32(self, a: Self::F32x8) -> [i32; 8];
    /// [`to_i32`](Self::to_i32) of floats as registers hold them, in words, and so is the result.
    #[inline(always)]
    fn truncate_words(self, words: &[u32; 8]) -> [u32; 8] {
        let floats = self.load(&array::map(*words, f32::from_bits));
        array::map(self.to_i32(floats), |integer| integer as u32)
    }
}

impl F32x8Ops for BaselineSimd {
    type F32x8 = [F32x4; 2];

    #[inline(always)]
    fn load(self, values: &[f32; 8]) -> [F32x4; 2] {
        let [a, b, c, d, e, f, g, h] = *values;
        [F32x4::new([a, b, c, d]), F32x4::new([e, f, g, h])]
    }

    #[inline(always)]
    fn splat(self, value: f32) -> [F32x4; 2] {
        [F32x4::splat(value); 2]
    }

    #[inline(always)]
    fn to_array(self, [low, high]: [F32x4; 2]) -> [f32; 8] {
        let ([a, b, c, d], [e, f, g, h]) = (low.to_array(), high.to_array());
        [a, b, c, d, e, f, g, h]
    }

    #[inline(always)]
    fn sub(self, a: [F32x4; 2], b: [F32x4; 2]) -> [F32x4; 2] {
        [a[0] - b[0], a[1] - b[1]]
    }

    #[inline(always)]
    fn mul(self, a: [F32x4; 2], b: [F32x4; 2]) -> [F32x4; 2] {
        [a[0] * b[0], a[1] * b[1]]
    }

    #[inline(always)]
    fn add(self, a: [F32x4; 2], b: [F32x4; 2]) -> [F32x4; 2] {
        [a[0] + b[0], a[1] + b[1]]
    }

    #[inline(always)]
    fn div(self, a: [F32x4; 2], b: [F32x4; 2]) -> [F32x4; 2] {
        [a[0] / b[0], a[1] / b[1]]
    }

    #[inline(always)]
    fn abs(self, a: [F32x4; 2]) -> [F32x4; 2] {
        [a[0].abs(), a[1].abs()]
    }

    #[inline(always)]
    fn signum(self, a: [F32x4; 2]) -> [F32x4; 2] {
        let sign = |four: F32x4| F32x4::new(array::map(four.to_array(), |x| 1f32.copysign(x)));
        [sign(a[0]), sign(a[1])]
    }

    #[inline(always)]
    fn max(self, a: [F32x4; 2], b: [F32x4; 2]) -> [F32x4; 2] {
        [a[0].max(b[0]), a[1].max(b[1])]
    }

    #[inline(always)]
    fn min(self, a: [F32x4; 2], b: [F32x4; 2]) -> [F32x4; 2] {
        [a[0].min(b[0]), a[1].min(b[1])]
    }

    #[inline(always)]
    fn cmp_ge(self, a: [F32x4; 2], b: [F32x4; 2]) -> u32 {
        a[0].cmp_ge(b[0]) | a[1].cmp_ge(b[1]) << 4
    }

    #[inline(always)]
    fn to_i32(self, a: [F32x4; 2]) -> [i32; 8] {
        array::map(self.to_array(a), float::to_i32)
    }
}

/// One AVX register. To be used in code that [`V3::vectorize`] compiles.
#[cfg(target_arch = "x86_64")]
impl F32x8Ops for V3 {
    type F32x8 = f32x8;

    #[inline(always)]
    fn load(self, values: &[f32; 8]) -> f32x8 {
        pulp::cast(*values)
    }

    #[inline(always)]
    fn splat(self, value: f32) -> f32x8 {
        self.splat_f32x8(value)
    }

    #[inline(always)]
    fn to_array(self, value: f32x8) -> [f32; 8] {
        pulp::cast(value)
    }

    #[inline(always)]
    fn sub(self, a: f32x8, b: f32x8) -> f32x8 {
        pulp::cast(self.avx._mm256_sub_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn mul(self, a: f32x8, b: f32x8) -> f32x8 {
        pulp::cast(self.avx._mm256_mul_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn add(self, a: f32x8, b: f32x8) -> f32x8 {
        pulp::cast(self.avx._mm256_add_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn div(self, a: f32x8, b: f32x8) -> f32x8 {
        pulp::cast(self.avx._mm256_div_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn abs(self, a: f32x8) -> f32x8 {
        self.abs_f32x8(a)
    }

    #[inline(always)]
    fn signum(self, a: f32x8) -> f32x8 {
        self.or_f32x8(self.and_f32x8(a, self.splat_f32x8(-0.0)), self.splat_f32x8(1.0))
    }

    #[inline(always)]
    fn max(self, a: f32x8, b: f32x8) -> f32x8 {
        // `vmaxps` returns its second operand unless the first is greater.
        pulp::cast(self.avx._mm256_max_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn min(self, a: f32x8, b: f32x8) -> f32x8 {
        pulp::cast(self.avx._mm256_min_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn cmp_ge(self, a: f32x8, b: f32x8) -> u32 {
        let wide = self.cmp_ge_f32x8(a, b);
        self.avx._mm256_movemask_ps(pulp::cast(wide)) as u32
    }

    #[inline(always)]
    fn to_i32(self, a: f32x8) -> [i32; 8] {
        // The conversion gives i32::MIN out of range: it is inverted above the range and cleared
        // for a NaN.
        let above = self.cmp_ge_f32x8(a, self.splat_f32x8(2_147_483_648.0));
        let number = self.cmp_eq_f32x8(a, a);
        let truncated = self.avx._mm256_cvttps_epi32(pulp::cast(a));
        let saturated = self.avx2._mm256_xor_si256(truncated, pulp::cast(above));
        pulp::cast(self.avx2._mm256_and_si256(saturated, pulp::cast(number)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPECIAL: [f32; 8] = [0.0, -0.0, 1.0, -2.5, 1e-45, f32::MAX, f32::INFINITY, f32::NAN];

    /// All results of an operation for all pairs of special numbers, as bits.
    fn results<E: F32x8Ops>(simd: E) -> Vec<u32> {
        let mut all = Vec::new();
        for shift in 0..8 {
            let (x, y) = (SPECIAL, std::array::from_fn(|lane| SPECIAL[(lane + shift) % 8]));
            let (a, b) = (simd.load(&x), simd.load(&y));
            let made = [
                simd.sub(a, b),
                simd.mul(a, b),
                simd.add(a, b),
                simd.div(a, b),
                simd.abs(a),
                simd.signum(a),
                simd.max(a, b),
                simd.min(a, b),
            ];
            for lane in made.into_iter().flat_map(|made| simd.to_array(made)) {
                all.push(if lane.is_nan() { f32::NAN.to_bits() } else { lane.to_bits() });
            }
            all.push(simd.cmp_ge(a, b));
            // IEEE 754 by hand: the comparison, and the choice of the second operand for a NaN.
            for lane in 0..8 {
                assert_eq!(simd.cmp_ge(a, b) >> lane & 1 != 0, x[lane] >= y[lane]);
                assert_eq!(
                    simd.to_array(simd.signum(a))[lane].is_sign_negative(),
                    x[lane].is_sign_negative()
                );
                assert_eq!(simd.to_array(simd.signum(a))[lane].abs(), 1.0);
                assert_eq!(simd.to_array(simd.abs(a))[lane].to_bits(), x[lane].to_bits() & 0x7FFF_FFFF);
                assert_eq!(simd.to_i32(a)[lane], x[lane] as i32);
                let above = if x[lane] > y[lane] { x[lane] } else { y[lane] };
                let found = simd.to_array(simd.max(a, b))[lane];
                assert!(found.to_bits() == above.to_bits() || found.is_nan() && above.is_nan());
            }
        }
        all
    }

    #[test]
    fn both_ways_agree() {
        let fours = results(BaselineSimd);
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = V3::try_new() {
            assert_eq!(results(simd), fours);
        }
        assert_eq!(fours.len(), 8 * 65);
    }
}
