//! Four `f64` lanes of SIMD: scalars, or one AVX register if the CPU has them.
//!
//! These are for filters with an error bound only: whether a multiply-add rounds its product
//! depends on the CPU. Both ways keep the bounds of `error_bound`, so that a decision of the filter
//! is always right.

#[cfg(target_arch = "x86_64")]
use pulp::f64x4;
#[cfg(target_arch = "x86_64")]
use pulp::x86::V3;

use crate::math::array;
use crate::math::baseline_simd::BaselineSimd;

/// Operations on four `f64` lanes.
pub trait F64x4Ops: Copy {
    /// Four lanes.
    type F64x4: Copy;

    /// Widens four `f32`, exactly.
    fn load_f32(self, values: &[f32; 4]) -> Self::F64x4;
    /// Rounds each lane to `f32`, to nearest even.
    fn to_f32(self, value: Self::F64x4) -> [f32; 4];
    /// Makes a value from its lanes.
    fn load_f64(self, values: [f64; 4]) -> Self::F64x4;
    /// One value in all lanes.
    fn splat(self, value: f64) -> Self::F64x4;
    /// `a + b` in each lane.
    fn add(self, a: Self::F64x4, b: Self::F64x4) -> Self::F64x4;
    /// `a - b` in each lane.
    fn sub(self, a: Self::F64x4, b: Self::F64x4) -> Self::F64x4;
    /// `a b` in each lane.
    fn mul(self, a: Self::F64x4, b: Self::F64x4) -> Self::F64x4;
    /// `a / b` in each lane.
    fn div(self, a: Self::F64x4, b: Self::F64x4) -> Self::F64x4;
    /// `a b + c`; the product may be rounded or not.
    fn mul_add(self, a: Self::F64x4, b: Self::F64x4, c: Self::F64x4) -> Self::F64x4;
    /// `a b - c`; the product may be rounded or not.
    fn mul_sub(self, a: Self::F64x4, b: Self::F64x4, c: Self::F64x4) -> Self::F64x4;
    /// `c - a b`; the product may be rounded or not.
    fn neg_mul_add(self, a: Self::F64x4, b: Self::F64x4, c: Self::F64x4) -> Self::F64x4;
    /// The square root of each lane.
    fn sqrt(self, a: Self::F64x4) -> Self::F64x4;
    /// The absolute value of each lane.
    fn abs(self, a: Self::F64x4) -> Self::F64x4;
    /// A mask of the lanes in which `a > b`.
    fn cmp_gt(self, a: Self::F64x4, b: Self::F64x4) -> u32;

    /// A mask of the lanes in which `a >= b`.
    fn cmp_ge(self, a: Self::F64x4, b: Self::F64x4) -> u32;

    /// The maximum of each lane; unspecified which of the two if one is a NaN.
    fn relaxed_max(self, a: Self::F64x4, b: Self::F64x4) -> Self::F64x4;
    /// Of (x, y, z, w): (x, y, z, 0).
    fn xyz0(self, v: Self::F64x4) -> Self::F64x4;
    /// Of (x, y, z, w): x, y and z, each in all lanes.
    fn splat_xyz(self, v: Self::F64x4) -> [Self::F64x4; 3];
    /// Of (x, y, z, w): (y, z, x, w).
    fn yzx(self, v: Self::F64x4) -> Self::F64x4;
    /// The sum of all lanes, in all lanes; each lane goes through two additions.
    fn reduce_sum(self, v: Self::F64x4) -> Self::F64x4;
    /// The sums of the lanes of each of four values; each lane goes through two additions.
    fn reduce_sums(self, v: [Self::F64x4; 4]) -> Self::F64x4;

    /// The difference `a - b` of three-component vectors.
    #[inline(always)]
    fn sub3(self, a: [Self::F64x4; 3], b: [Self::F64x4; 3]) -> [Self::F64x4; 3] {
        [self.sub(a[0], b[0]), self.sub(a[1], b[1]), self.sub(a[2], b[2])]
    }

    /// The dot product of three-component vectors.
    #[inline(always)]
    fn dot3(self, a: [Self::F64x4; 3], b: [Self::F64x4; 3]) -> Self::F64x4 {
        self.mul_add(a[0], b[0], self.mul_add(a[1], b[1], self.mul(a[2], b[2])))
    }

    /// The cross product.
    #[inline(always)]
    fn cross3(self, a: [Self::F64x4; 3], b: [Self::F64x4; 3]) -> [Self::F64x4; 3] {
        [
            self.mul_sub(a[1], b[2], self.mul(a[2], b[1])),
            self.mul_sub(a[2], b[0], self.mul(a[0], b[2])),
            self.mul_sub(a[0], b[1], self.mul(a[1], b[0])),
        ]
    }

    /// The 1-norm: the sum of the absolute components.
    #[inline(always)]
    fn norm1(self, v: [Self::F64x4; 3]) -> Self::F64x4 {
        self.add(self.add(self.abs(v[0]), self.abs(v[1])), self.abs(v[2]))
    }
}

/// On the baseline: arrays.
impl F64x4Ops for BaselineSimd {
    type F64x4 = [f64; 4];

    #[inline(always)]
    fn load_f32(self, values: &[f32; 4]) -> [f64; 4] {
        array::map(*values, f64::from)
    }

    #[inline(always)]
    fn to_f32(self, value: [f64; 4]) -> [f32; 4] {
        array::map(value, |x| x as f32)
    }

    #[inline(always)]
    fn load_f64(self, values: [f64; 4]) -> [f64; 4] {
        values
    }

    #[inline(always)]
    fn splat(self, value: f64) -> [f64; 4] {
        [value; 4]
    }

    #[inline(always)]
    fn add(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        array::from_fn(|lane| a[lane] + b[lane])
    }

    #[inline(always)]
    fn sub(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        array::from_fn(|lane| a[lane] - b[lane])
    }

    #[inline(always)]
    fn mul(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        array::from_fn(|lane| a[lane] * b[lane])
    }

    #[inline(always)]
    fn div(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        array::from_fn(|lane| a[lane] / b[lane])
    }

    #[inline(always)]
    fn mul_add(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        array::from_fn(|lane| a[lane] * b[lane] + c[lane])
    }

    #[inline(always)]
    fn mul_sub(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        array::from_fn(|lane| a[lane] * b[lane] - c[lane])
    }

    #[inline(always)]
    fn neg_mul_add(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        array::from_fn(|lane| c[lane] - a[lane] * b[lane])
    }

    #[inline(always)]
    fn sqrt(self, a: [f64; 4]) -> [f64; 4] {
        array::map(a, f64::sqrt)
    }

    #[inline(always)]
    fn abs(self, a: [f64; 4]) -> [f64; 4] {
        array::map(a, f64::abs)
    }

    #[inline(always)]
    fn relaxed_max(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        array::from_fn(|lane| if a[lane] > b[lane] { a[lane] } else { b[lane] })
    }

    #[inline(always)]
    fn xyz0(self, [x, y, z, _]: [f64; 4]) -> [f64; 4] {
        [x, y, z, 0.0]
    }

    #[inline(always)]
    fn splat_xyz(self, [x, y, z, _]: [f64; 4]) -> [[f64; 4]; 3] {
        [[x; 4], [y; 4], [z; 4]]
    }

    #[inline(always)]
    fn yzx(self, [x, y, z, w]: [f64; 4]) -> [f64; 4] {
        [y, z, x, w]
    }

    #[inline(always)]
    fn reduce_sum(self, [x, y, z, w]: [f64; 4]) -> [f64; 4] {
        [(x + z) + (y + w); 4]
    }

    #[inline(always)]
    fn reduce_sums(self, v: [[f64; 4]; 4]) -> [f64; 4] {
        array::map(v, |[x, y, z, w]| (x + y) + (z + w))
    }

    #[inline(always)]
    fn cmp_gt(self, a: [f64; 4], b: [f64; 4]) -> u32 {
        (0..4).fold(0, |all, lane| all | u32::from(a[lane] > b[lane]) << lane)
    }

    #[inline(always)]
    fn cmp_ge(self, a: [f64; 4], b: [f64; 4]) -> u32 {
        (0..4).fold(0, |all, lane| all | u32::from(a[lane] >= b[lane]) << lane)
    }
}

/// One AVX register. To be used in code that [`V3::vectorize`] compiles.
#[cfg(target_arch = "x86_64")]
impl F64x4Ops for V3 {
    type F64x4 = f64x4;

    #[inline(always)]
    fn load_f32(self, values: &[f32; 4]) -> f64x4 {
        self.convert_f32x4_to_f64x4(pulp::cast(*values))
    }

    #[inline(always)]
    fn to_f32(self, value: f64x4) -> [f32; 4] {
        pulp::cast(self.convert_f64x4_to_f32x4(value))
    }

    #[inline(always)]
    fn load_f64(self, values: [f64; 4]) -> f64x4 {
        pulp::cast(values)
    }

    #[inline(always)]
    fn splat(self, value: f64) -> f64x4 {
        self.splat_f64x4(value)
    }

    #[inline(always)]
    fn add(self, a: f64x4, b: f64x4) -> f64x4 {
        pulp::cast(self.avx._mm256_add_pd(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn sub(self, a: f64x4, b: f64x4) -> f64x4 {
        pulp::cast(self.avx._mm256_sub_pd(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn mul(self, a: f64x4, b: f64x4) -> f64x4 {
        pulp::cast(self.avx._mm256_mul_pd(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn div(self, a: f64x4, b: f64x4) -> f64x4 {
        pulp::cast(self.avx._mm256_div_pd(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn mul_add(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.mul_add_f64x4(a, b, c)
    }

    #[inline(always)]
    fn mul_sub(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.mul_sub_f64x4(a, b, c)
    }

    #[inline(always)]
    fn neg_mul_add(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.negate_mul_add_f64x4(a, b, c)
    }

    #[inline(always)]
    fn sqrt(self, a: f64x4) -> f64x4 {
        pulp::cast(self.avx._mm256_sqrt_pd(pulp::cast(a)))
    }

    #[inline(always)]
    fn abs(self, a: f64x4) -> f64x4 {
        self.abs_f64x4(a)
    }

    #[inline(always)]
    fn relaxed_max(self, a: f64x4, b: f64x4) -> f64x4 {
        pulp::cast(self.avx._mm256_max_pd(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn xyz0(self, v: f64x4) -> f64x4 {
        pulp::cast(self.avx._mm256_blend_pd::<0b1000>(pulp::cast(v), self.avx._mm256_setzero_pd()))
    }

    #[inline(always)]
    fn splat_xyz(self, v: f64x4) -> [f64x4; 3] {
        let (avx2, v) = (self.avx2, pulp::cast(v));
        [
            pulp::cast(avx2._mm256_permute4x64_pd::<0b00_00_00_00>(v)),
            pulp::cast(avx2._mm256_permute4x64_pd::<0b01_01_01_01>(v)),
            pulp::cast(avx2._mm256_permute4x64_pd::<0b10_10_10_10>(v)),
        ]
    }

    #[inline(always)]
    fn yzx(self, v: f64x4) -> f64x4 {
        pulp::cast(self.avx2._mm256_permute4x64_pd::<0b11_00_10_01>(pulp::cast(v)))
    }

    #[inline(always)]
    fn reduce_sum(self, v: f64x4) -> f64x4 {
        let v = pulp::cast(v);
        let pairs = self.avx._mm256_add_pd(v, self.avx2._mm256_permute4x64_pd::<0b01_00_11_10>(v));
        pulp::cast(self.avx._mm256_add_pd(pairs, self.avx._mm256_permute_pd::<0b0101>(pairs)))
    }

    #[inline(always)]
    fn reduce_sums(self, [a, b, c, d]: [f64x4; 4]) -> f64x4 {
        let (avx, a, b, c, d) = (self.avx, pulp::cast(a), pulp::cast(b), pulp::cast(c), pulp::cast(d));
        // The sums of lanes 0 and 1 of both, then those of lanes 2 and 3.
        let pairs = |a, b| avx._mm256_add_pd(avx._mm256_unpacklo_pd(a, b), avx._mm256_unpackhi_pd(a, b));
        let (ab, cd) = (pairs(a, b), pairs(c, d));
        let crossed = avx._mm256_permute2f128_pd::<0x21>(ab, cd);
        let straight = avx._mm256_blend_pd::<0b1100>(ab, cd);
        pulp::cast(avx._mm256_add_pd(straight, crossed))
    }

    #[inline(always)]
    fn cmp_gt(self, a: f64x4, b: f64x4) -> u32 {
        let wide = self.cmp_gt_f64x4(a, b);
        self.avx._mm256_movemask_pd(pulp::cast(wide)) as u32
    }

    #[inline(always)]
    fn cmp_ge(self, a: f64x4, b: f64x4) -> u32 {
        let wide = self.cmp_ge_f64x4(a, b);
        self.avx._mm256_movemask_pd(pulp::cast(wide)) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers whose products and sums need no rounding, so that both ways must agree with hand
    /// arithmetic.
    fn check<D: F64x4Ops>(simd: D) {
        let a = simd.load_f32(&[1.5, -2.0, 0.0, 1e30]);
        let b = simd.load_f32(&[0.5, 4.0, -0.0, f32::NAN]);
        let c = simd.splat(-8.0);
        let numbers = |four: D::F64x4| simd.to_f32(four)[..3].to_vec();
        assert_eq!(numbers(simd.add(a, b)), [2.0, 2.0, 0.0]);
        assert_eq!(numbers(simd.sub(a, b)), [1.0, -6.0, 0.0]);
        assert_eq!(numbers(simd.mul(a, b)), [0.75, -8.0, 0.0]);
        assert_eq!(numbers(simd.div(a, b))[..2], [3.0, -0.5]);
        assert_eq!(numbers(simd.mul_add(a, b, c)), [-7.25, -16.0, -8.0]);
        assert_eq!(numbers(simd.mul_sub(a, b, c)), [8.75, 0.0, 8.0]);
        assert_eq!(numbers(simd.neg_mul_add(a, b, c)), [-8.75, 0.0, -8.0]);
        assert_eq!(numbers(simd.sqrt(simd.mul(a, a))), [1.5, 2.0, 0.0]);
        assert_eq!(numbers(simd.abs(c)), [8.0; 3]);
        assert_eq!(numbers(simd.relaxed_max(simd.load_f64([1.0, 5.0, -3.0, 0.0]), a)), [1.5, 5.0, 0.0]);
        let lanes = |four: D::F64x4| simd.to_f32(four);
        let v = simd.load_f64([1.0, 20.0, 300.0, 4000.0]);
        assert_eq!(lanes(simd.xyz0(v)), [1.0, 20.0, 300.0, 0.0]);
        assert_eq!(simd.splat_xyz(v).map(lanes), [[1.0; 4], [20.0; 4], [300.0; 4]]);
        assert_eq!(lanes(simd.yzx(v)), [20.0, 300.0, 1.0, 4000.0]);
        assert_eq!(lanes(simd.reduce_sum(v)), [4321.0; 4]);
        let halves = simd.mul(v, simd.splat(0.5));
        assert_eq!(lanes(simd.reduce_sums([v, c, halves, v])), [4321.0, -32.0, 2160.5, 4321.0]);
        assert_eq!(simd.cmp_gt(a, b), 0b0001);
        assert_eq!(simd.cmp_gt(b, c), 0b0111);
        // (1, 2, 3) x (4, 5, 6) = (-3, 6, -3), and their product is 32.
        let v = [1.0, 2.0, 3.0].map(|x| simd.splat(x));
        let w = [4.0, 5.0, 6.0].map(|x| simd.splat(x));
        assert_eq!(simd.cross3(v, w).map(|x| simd.to_f32(x)[3]), [-3.0, 6.0, -3.0]);
        assert_eq!(simd.to_f32(simd.dot3(v, w)), [32.0; 4]);
        assert_eq!(simd.to_f32(simd.norm1(simd.sub3(v, w))), [9.0; 4]);
    }

    #[test]
    fn both_ways_calculate() {
        check(BaselineSimd);
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = V3::try_new() {
            check(simd);
        }
    }
}
