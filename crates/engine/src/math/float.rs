//! The float types of shaders and the functions that the instruction set needs of them.
//!
//! Elementary functions are correctly rounded in f32: crate `pxfm`, corrected in [`hard`] and
//! [`power`]. f16 goes through a wider type: one f32 operation rounded to f16 is correctly rounded
//! for the basic operations and the square root (24 >= 2 * 11 + 2 bits), and a f64 evaluation
//! rounded once is for the elementary functions.

use half::f16;

use crate::math::exponent::Exponent;
use crate::math::{hard, power};

/// Converts like `a as i32`, in operations that the compiler vectorises: the sum of 1.5 * 2^52 and
/// an integer of 32 bits holds this in its lowest bits, in two's complement.
#[inline(always)]
pub fn to_i32(a: f32) -> i32 {
    let inside = trunc_and_clamp(a, i32::MIN.into(), i32::MAX.into());
    if a.is_nan() { 0 } else { (inside + 1.5 * TWO_TO_52).to_bits() as i32 }
}

/// Converts like `a as u32`, by a sum with 2^52.
#[inline(always)]
pub fn to_u32(a: f32) -> u32 {
    let inside = trunc_and_clamp(a, 0.0, u32::MAX.into());
    if a.is_nan() { 0 } else { (inside + TWO_TO_52).to_bits() as u32 }
}

const TWO_TO_52: f64 = 4_503_599_627_370_496.0;

/// Truncates a number to an integer and clamps it.
#[inline(always)]
fn trunc_and_clamp(a: f32, low: f64, high: f64) -> f64 {
    let whole = f64::from(a.trunc());
    let raised = if whole > low { whole } else { low };
    if raised < high { raised } else { high }
}

/// A float type of SPIR-V.
pub trait Float: Copy + PartialOrd {
    /// The number 0.
    const ZERO: Self;
    /// The number 1.
    const ONE: Self;
    /// Rounds a f64 once.
    fn of(value: f64) -> Self;
    /// Rounds to an integer towards minus infinity.
    fn floor(self) -> Self;
    /// Rounds to an integer towards plus infinity.
    fn ceil(self) -> Self;
    /// Rounds to an integer towards zero.
    fn trunc(self) -> Self;
    /// To nearest, ties to even.
    fn round_even(self) -> Self;
    /// To nearest, ties away from zero.
    fn round(self) -> Self;
    /// The absolute value.
    fn abs(self) -> Self;
    /// Whether it is a NaN.
    fn is_nan(self) -> bool;
    /// Whether it is an infinity.
    fn is_infinite(self) -> bool;
    /// Magnitude of self, sign of another.
    fn copysign(self, sign: Self) -> Self;
    /// The square root.
    fn sqrt(self) -> Self;
    /// Reciprocal square root, rounded once.
    fn inverse_sqrt(self) -> Self;
    /// Product and sum, rounded once.
    fn mul_add(self, factor: Self, summand: Self) -> Self;
    /// Mantissa in [0.5, 1) with the sign, and exponent; zero, infinity and NaN have exponent 0.
    fn frexp(self) -> (Self, i32);
    /// Times a power of two, rounded once.
    fn ldexp(self, exponent: i32) -> Self;
    /// The sine.
    fn sin(self) -> Self;
    /// The cosine.
    fn cos(self) -> Self;
    /// The tangent.
    fn tan(self) -> Self;
    /// The inverse sine.
    fn asin(self) -> Self;
    /// The inverse cosine.
    fn acos(self) -> Self;
    /// The inverse tangent.
    fn atan(self) -> Self;
    /// Inverse tangent of `self / x` in the right quadrant.
    fn atan2(self, x: Self) -> Self;
    /// The hyperbolic sine.
    fn sinh(self) -> Self;
    /// The hyperbolic cosine.
    fn cosh(self) -> Self;
    /// The hyperbolic tangent.
    fn tanh(self) -> Self;
    /// The inverse hyperbolic sine.
    fn asinh(self) -> Self;
    /// The inverse hyperbolic cosine.
    fn acosh(self) -> Self;
    /// The inverse hyperbolic tangent.
    fn atanh(self) -> Self;
    /// `self` to the power of `exponent`.
    fn pow(self, exponent: Self) -> Self;
    /// e to the power.
    fn exp(self) -> Self;
    /// 2 to the power.
    fn exp2(self) -> Self;
    /// The natural logarithm.
    fn log(self) -> Self;
    /// The binary logarithm.
    fn log2(self) -> Self;
}

macro_rules! native {
    ($ty:ty, $($method:ident = $function:path),* $(,)?) => {
        impl Float for $ty {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $ty
            }
            #[inline(always)]
            fn floor(self) -> Self {
                <$ty>::floor(self)
            }
            #[inline(always)]
            fn ceil(self) -> Self {
                <$ty>::ceil(self)
            }
            #[inline(always)]
            fn trunc(self) -> Self {
                <$ty>::trunc(self)
            }
            #[inline(always)]
            fn round_even(self) -> Self {
                <$ty>::round_ties_even(self)
            }
            #[inline(always)]
            fn round(self) -> Self {
                <$ty>::round(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$ty>::abs(self)
            }
            #[inline(always)]
            fn is_nan(self) -> bool {
                <$ty>::is_nan(self)
            }
            #[inline(always)]
            fn is_infinite(self) -> bool {
                <$ty>::is_infinite(self)
            }
            #[inline(always)]
            fn copysign(self, sign: Self) -> Self {
                <$ty>::copysign(self, sign)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$ty>::sqrt(self)
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, summand: Self) -> Self {
                <$ty>::mul_add(self, factor, summand)
            }
            #[inline(always)]
            fn frexp(self) -> (Self, i32) {
                Exponent::frexp(self)
            }
            #[inline(always)]
            fn ldexp(self, exponent: i32) -> Self {
                Exponent::ldexp(self, exponent)
            }
            // Never inlined: a row's loop over the lanes would hold as many copies.
            $(#[inline(never)]
            fn $method(self) -> Self {
                $function(self)
            })*
            #[inline(never)]
            fn atan2(self, x: Self) -> Self {
                BinaryFunctions::atan2(self, x)
            }
            #[inline(never)]
            fn pow(self, exponent: Self) -> Self {
                BinaryFunctions::pow(self, exponent)
            }
        }
    };
}

/// The hyperbolic sine. (`pxfm::f_sinh` gives +0 for -0.)
fn f64_sinh(a: f64) -> f64 {
    if a == 0.0 { a } else { pxfm::f_sinh(a) }
}

/// The functions of two operands.
trait BinaryFunctions {
    fn atan2(self, x: Self) -> Self;
    fn pow(self, exponent: Self) -> Self;
}

impl BinaryFunctions for f32 {
    fn atan2(self, x: Self) -> Self {
        pxfm::f_atan2f(self, x)
    }
    fn pow(self, exponent: Self) -> Self {
        power::pow_f32(self, exponent)
    }
}

impl BinaryFunctions for f64 {
    fn atan2(self, x: Self) -> Self {
        pxfm::f_atan2(self, x)
    }
    fn pow(self, exponent: Self) -> Self {
        power::pow_f64(self, exponent)
    }
}

native!(
    f32,
    inverse_sqrt = pxfm::f_rsqrtf,
    sin = hard::sin,
    cos = hard::cos,
    tan = hard::tan,
    asin = pxfm::f_asinf,
    acos = pxfm::f_acosf,
    atan = pxfm::f_atanf,
    sinh = pxfm::f_sinhf,
    cosh = pxfm::f_coshf,
    tanh = pxfm::f_tanhf,
    asinh = hard::asinh,
    acosh = hard::acosh,
    atanh = pxfm::f_atanhf,
    exp = hard::exp,
    exp2 = hard::exp2,
    log = pxfm::f_logf,
    log2 = pxfm::f_log2f,
);
native!(
    f64,
    inverse_sqrt = pxfm::f_rsqrt,
    sin = pxfm::f_sin,
    cos = pxfm::f_cos,
    tan = pxfm::f_tan,
    asin = pxfm::f_asin,
    acos = pxfm::f_acos,
    atan = pxfm::f_atan,
    sinh = f64_sinh,
    cosh = pxfm::f_cosh,
    tanh = pxfm::f_tanh,
    asinh = pxfm::f_asinh,
    acosh = pxfm::f_acosh,
    atanh = pxfm::f_atanh,
    exp = pxfm::f_exp,
    exp2 = pxfm::f_exp2,
    log = pxfm::f_log,
    log2 = pxfm::f_log2,
);

/// The f16 nearest to a f64, ties to even, rounded once.
///
/// (`f16::from_f64` rounds twice, or looks at the upper half of the number only.)
pub fn f64_to_f16(value: f64) -> f16 {
    f16::from_f32(f64_to_f32_odd(value))
}

/// Rounds a f64 to odd in f32, so that rounding the result to f16 is rounding once.
///
/// The last bit is set where something was lost, and 24 bits are enough for the 11 of f16.
pub fn f64_to_f32_odd(value: f64) -> f32 {
    let near = value as f32;
    let back = f64::from(near);
    if back == value || !near.is_finite() {
        return near;
    }
    let towards_zero = near.to_bits() - u32::from(back.abs() > value.abs());
    f32::from_bits(towards_zero | 1)
}

macro_rules! through_f64 {
    ($($method:ident),*) => {$(
        #[inline(never)]
        fn $method(self) -> Self {
            f64_to_f16(Float::$method(self.to_f64()))
        }
    )*};
}

impl Float for f16 {
    const ZERO: Self = f16::ZERO;
    const ONE: Self = f16::ONE;
    fn of(value: f64) -> Self {
        f64_to_f16(value)
    }
    fn is_nan(self) -> bool {
        f16::is_nan(self)
    }
    fn is_infinite(self) -> bool {
        f16::is_infinite(self)
    }
    fn abs(self) -> Self {
        f16::from_bits(self.to_bits() & 0x7FFF)
    }
    fn copysign(self, sign: Self) -> Self {
        f16::copysign(self, sign)
    }
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        // The product of two f16 is exact in f64, and so is its sum with a third.
        f64_to_f16(self.to_f64() * factor.to_f64() + summand.to_f64())
    }
    fn frexp(self) -> (Self, i32) {
        let (mantissa, exponent) = Float::frexp(self.to_f64());
        (f64_to_f16(mantissa), exponent)
    }
    fn ldexp(self, exponent: i32) -> Self {
        f64_to_f16(Float::ldexp(self.to_f64(), exponent))
    }
    fn atan2(self, x: Self) -> Self {
        let angle = Float::atan2(self.to_f64(), x.to_f64());
        // The arc tangent of a small quotient is a little less, by too little for f64 to show;
        // where the quotient is the middle of two denormals that decides.
        let small = angle != 0.0 && angle.abs() < 1.0 / 16_384.0;
        f64_to_f16(if small { f64::from_bits(angle.to_bits() - 1) } else { angle })
    }
    fn pow(self, exponent: Self) -> Self {
        f64_to_f16(Float::pow(self.to_f64(), exponent.to_f64()))
    }
    through_f64!(
        floor,
        ceil,
        trunc,
        round_even,
        round,
        sqrt,
        inverse_sqrt,
        sin,
        cos,
        tan,
        asin,
        acos,
        atan,
        sinh,
        cosh,
        tanh,
        asinh,
        acosh,
        atanh,
        exp,
        exp2,
        log,
        log2
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_become_integers_as_casts_do() {
        let mut bits = 1u32;
        let drawn = (0..100_000).map(|_| {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from_bits(bits ^ bits >> 15)
        });
        let edges = [0.0, 0.5, 1.0, 8_388_608.0, 16_777_216.0, 2_147_483_648.0, 4_294_967_296.0, f32::MAX];
        let edges = edges.into_iter().chain([f32::INFINITY, f32::NAN, f32::MIN_POSITIVE, 1e-45]);
        let near = edges.flat_map(|x| [x, x.next_up(), x.next_down()]);
        for x in drawn.chain(near).flat_map(|x| [x, -x]) {
            assert_eq!((to_i32(x), to_u32(x)), (x as i32, x as u32), "{x:e}");
        }
    }

    #[test]
    fn frexp_takes_numbers_apart() {
        assert_eq!(Float::frexp(8.0f32), (0.5, 4));
        assert_eq!(Float::frexp(-0.75f32), (-0.75, 0));
        assert_eq!(Float::frexp(f32::from_bits(1)), (0.5, -148));
        assert_eq!(Float::frexp(f64::from_bits(1)), (0.5, -1073));
        assert_eq!(Float::frexp(-0.0f32).0.to_bits(), 0x8000_0000);
        assert_eq!(Float::frexp(f16::from_bits(1)), (f16::from_f32(0.5), -23));
    }

    #[test]
    fn a_half_is_rounded_once() {
        let half = |value: f64| f64_to_f16(value).to_bits();
        // 1 + 2^-11 is a tie, to the even neighbour 1; a little more is none, whatever the
        // distance.
        assert_eq!(half(1.0 + 2f64.powi(-11)), 0x3C00);
        assert_eq!(half(1.0 + 2f64.powi(-11) + 2f64.powi(-30)), 0x3C01);
        assert_eq!(half(1.0 + 2f64.powi(-11) + 2f64.powi(-52)), 0x3C01);
        assert_eq!(half(-1.0 - 3.0 * 2f64.powi(-11) + 2f64.powi(-52)), 0xBC01);
        // Half of the smallest denormal, and a little more.
        assert_eq!([half(2f64.powi(-25)), half(2f64.powi(-25) * (1.0 + 2f64.powi(-52)))], [0, 1]);
        assert_eq!([half(65_520.0), half(65_519.999_999_999), half(1e300)], [0x7C00, 0x7BFF, 0x7C00]);
        assert_eq!([half(-1e-300), half(f64::NEG_INFINITY)], [0x8000, 0xFC00]);
    }

    #[test]
    fn zeros_keep_their_sign() {
        assert_eq!(Float::sinh(-0.0f64).to_bits(), (-0.0f64).to_bits());
        assert_eq!(Float::sinh(f16::from_bits(0x8000)).to_bits(), 0x8000);
    }

    #[test]
    fn an_arc_tangent_is_less_than_its_quotient() {
        // 3 * 2^-24 / 2 is the middle of 2^-24 and 2^-23: the arc tangent lies below.
        let atan2 = |y, x| Float::atan2(f16::from_bits(y), f16::from_bits(x)).to_bits();
        assert_eq!([atan2(3, 0x4000), atan2(0x8003, 0x4000), atan2(1, 0x4000)], [1, 0x8001, 0]);
        assert_eq!(Float::atan2(f32::from_bits(3), 2.0).to_bits(), 1);
    }

    #[test]
    fn ldexp_rounds_once() {
        assert_eq!(Float::ldexp(1.0f32, -149), f32::from_bits(1));
        // 1.5 * 2^-149 is a tie between 1 and 2 units: the even one.
        assert_eq!(Float::ldexp(1.5f32, -149), f32::from_bits(2));
        assert_eq!(Float::ldexp(1.0f32, -150), 0.0);
        assert_eq!(Float::ldexp(f32::from_bits(1), 149), 1.0);
        assert_eq!(Float::ldexp(1.0f32, 128), f32::INFINITY);
        assert_eq!(Float::ldexp(1.0f32, i32::MIN), 0.0);
        assert_eq!(Float::ldexp(f32::from_bits(1), 276), 2f32.powi(127));
        assert_eq!(Float::ldexp(3.0f64, 4), 48.0);
    }
}
