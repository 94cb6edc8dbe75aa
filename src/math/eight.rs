//! Eight `f32` side by side: two SSE2 or NEON registers, or one of AVX where the processor has it.
//!
//! The operations are IEEE's, lane by lane, and those of `math::four`: results are the same bits
//! however the eight are made.

#[cfg(target_arch = "x86_64")]
use pulp::f32x8;
#[cfg(target_arch = "x86_64")]
use pulp::x86::V3;

use crate::math::float;
use crate::math::four::Four;

/// A way to operate on eight numbers at once.
pub trait Eights: Copy {
    /// Eight numbers.
    type Eight: Copy;

    /// Lane by lane.
    fn load(self, values: &[f32; 8]) -> Self::Eight;
    /// The same in all lanes.
    fn splat(self, value: f32) -> Self::Eight;
    /// The lanes.
    fn lanes(self, value: Self::Eight) -> [f32; 8];
    /// Differences.
    fn sub(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// Products.
    fn mul(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// Sums.
    fn add(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// Quotients.
    fn div(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// Magnitudes.
    fn abs(self, a: Self::Eight) -> Self::Eight;
    /// 1 or -1, by the sign bit.
    fn sign(self, a: Self::Eight) -> Self::Eight;
    /// `a` where it is greater, otherwise, and for a NaN in `a`, `b`.
    fn if_above(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// `a` where it is less, otherwise, and for a NaN in `a`, `b`.
    fn if_below(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// A bit for each lane in which `a` is greater or equal; none for a NaN.
    fn at_least(self, a: Self::Eight, b: Self::Eight) -> u32;
    /// Without what is behind the point; the nearest integer where there is none of that size, 0 for a NaN.
    fn to_integers(self, a: Self::Eight) -> [i32; 8];
}

/// Two vectors of four: on any machine.
#[derive(Clone, Copy, Debug)]
pub struct TwoFours;

impl Eights for TwoFours {
    type Eight = [Four; 2];

    #[inline(always)]
    fn load(self, values: &[f32; 8]) -> [Four; 2] {
        let [a, b, c, d, e, f, g, h] = *values;
        [Four::new([a, b, c, d]), Four::new([e, f, g, h])]
    }

    #[inline(always)]
    fn splat(self, value: f32) -> [Four; 2] {
        [Four::splat(value); 2]
    }

    #[inline(always)]
    fn lanes(self, [low, high]: [Four; 2]) -> [f32; 8] {
        let ([a, b, c, d], [e, f, g, h]) = (low.to_array(), high.to_array());
        [a, b, c, d, e, f, g, h]
    }

    #[inline(always)]
    fn sub(self, a: [Four; 2], b: [Four; 2]) -> [Four; 2] {
        [a[0] - b[0], a[1] - b[1]]
    }

    #[inline(always)]
    fn mul(self, a: [Four; 2], b: [Four; 2]) -> [Four; 2] {
        [a[0] * b[0], a[1] * b[1]]
    }

    #[inline(always)]
    fn add(self, a: [Four; 2], b: [Four; 2]) -> [Four; 2] {
        [a[0] + b[0], a[1] + b[1]]
    }

    #[inline(always)]
    fn div(self, a: [Four; 2], b: [Four; 2]) -> [Four; 2] {
        [a[0] / b[0], a[1] / b[1]]
    }

    #[inline(always)]
    fn abs(self, a: [Four; 2]) -> [Four; 2] {
        [a[0].abs(), a[1].abs()]
    }

    #[inline(always)]
    fn sign(self, a: [Four; 2]) -> [Four; 2] {
        let sign = |four: Four| Four::new(four.to_array().map(|x| 1f32.copysign(x)));
        [sign(a[0]), sign(a[1])]
    }

    #[inline(always)]
    fn if_above(self, a: [Four; 2], b: [Four; 2]) -> [Four; 2] {
        [a[0].if_above(b[0]), a[1].if_above(b[1])]
    }

    #[inline(always)]
    fn if_below(self, a: [Four; 2], b: [Four; 2]) -> [Four; 2] {
        [a[0].if_below(b[0]), a[1].if_below(b[1])]
    }

    #[inline(always)]
    fn at_least(self, a: [Four; 2], b: [Four; 2]) -> u32 {
        a[0].at_least(b[0]) | a[1].at_least(b[1]) << 4
    }

    #[inline(always)]
    fn to_integers(self, a: [Four; 2]) -> [i32; 8] {
        self.lanes(a).map(float::to_i32)
    }
}

/// One register of AVX; to be used in code that [`V3::vectorize`] compiles.
#[cfg(target_arch = "x86_64")]
impl Eights for V3 {
    type Eight = f32x8;

    #[inline(always)]
    fn load(self, values: &[f32; 8]) -> f32x8 {
        pulp::cast(*values)
    }

    #[inline(always)]
    fn splat(self, value: f32) -> f32x8 {
        self.splat_f32x8(value)
    }

    #[inline(always)]
    fn lanes(self, value: f32x8) -> [f32; 8] {
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
    fn sign(self, a: f32x8) -> f32x8 {
        self.or_f32x8(self.and_f32x8(a, self.splat_f32x8(-0.0)), self.splat_f32x8(1.0))
    }

    #[inline(always)]
    fn if_above(self, a: f32x8, b: f32x8) -> f32x8 {
        // The instruction gives its second operand unless the first is greater.
        pulp::cast(self.avx._mm256_max_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn if_below(self, a: f32x8, b: f32x8) -> f32x8 {
        pulp::cast(self.avx._mm256_min_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn at_least(self, a: f32x8, b: f32x8) -> u32 {
        let wide = self.cmp_ge_f32x8(a, b);
        self.avx._mm256_movemask_ps(pulp::cast(wide)) as u32
    }

    #[inline(always)]
    fn to_integers(self, a: f32x8) -> [i32; 8] {
        // What is outside becomes the least number: it is turned over where it was too great, and zero where it
        // was none.
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
    fn results<E: Eights>(eights: E) -> Vec<u32> {
        let mut all = Vec::new();
        for shift in 0..8 {
            let (x, y) = (SPECIAL, std::array::from_fn(|lane| SPECIAL[(lane + shift) % 8]));
            let (a, b) = (eights.load(&x), eights.load(&y));
            let made = [
                eights.sub(a, b),
                eights.mul(a, b),
                eights.add(a, b),
                eights.div(a, b),
                eights.abs(a),
                eights.sign(a),
                eights.if_above(a, b),
                eights.if_below(a, b),
            ];
            for lane in made.into_iter().flat_map(|made| eights.lanes(made)) {
                all.push(if lane.is_nan() { f32::NAN.to_bits() } else { lane.to_bits() });
            }
            all.push(eights.at_least(a, b));
            // IEEE 754 by hand: the comparison, and the choice of the second operand for a NaN.
            for lane in 0..8 {
                assert_eq!(eights.at_least(a, b) >> lane & 1 != 0, x[lane] >= y[lane]);
                assert_eq!(eights.lanes(eights.sign(a))[lane].is_sign_negative(), x[lane].is_sign_negative());
                assert_eq!(eights.lanes(eights.sign(a))[lane].abs(), 1.0);
                assert_eq!(eights.lanes(eights.abs(a))[lane].to_bits(), x[lane].to_bits() & 0x7FFF_FFFF);
                assert_eq!(eights.to_integers(a)[lane], x[lane] as i32);
                let above = if x[lane] > y[lane] { x[lane] } else { y[lane] };
                let found = eights.lanes(eights.if_above(a, b))[lane];
                assert!(found.to_bits() == above.to_bits() || found.is_nan() && above.is_nan());
            }
        }
        all
    }

    #[test]
    fn both_ways_agree() {
        let fours = results(TwoFours);
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = V3::try_new() {
            assert_eq!(results(simd), fours);
        }
        assert_eq!(fours.len(), 8 * 65);
    }
}
