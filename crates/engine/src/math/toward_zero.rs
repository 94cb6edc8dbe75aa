//! Float arithmetic that rounds towards zero, in integers: exact results, truncated.

use half::f16;

/// A float format: its precision and the exponent of its smallest denormal's bit.
pub trait RoundTowardZero: Copy {
    /// Bits of the significand.
    const PRECISION: i32;
    /// The exponent of the last bit of denormals.
    const MIN_EXPONENT: i32;
    /// The number of bits of the format.
    const WIDTH: i32;
    /// The encoding of the number.
    fn to_word(self) -> u64;
    /// The number of an encoding.
    fn from_word(bits: u64) -> Self;

    /// Whether it is a denormal: smaller than every normal number, and not zero.
    fn is_denormal(self) -> bool {
        let magnitude = self.to_word() & ((1 << (Self::WIDTH - 1)) - 1);
        magnitude != 0 && magnitude < 1 << (Self::PRECISION - 1)
    }
}

macro_rules! formats {
    ($($ty:ty, $word:ty, $width:literal, $precision:literal, $least:literal;)*) => {$(
        impl RoundTowardZero for $ty {
            const PRECISION: i32 = $precision;
            const MIN_EXPONENT: i32 = $least;
            const WIDTH: i32 = $width;
            fn to_word(self) -> u64 {
                self.to_bits().into()
            }
            fn from_word(bits: u64) -> Self {
                Self::from_bits(bits as $word)
            }
        }
    )*};
}

formats! {
    f16, u16, 16, 11, -24;
    f32, u32, 32, 24, -149;
    f64, u64, 64, 53, -1074;
}

/// A number `±significand * 2^exponent`, plus a little more of the same sign where `more`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnpackedFloat {
    negative: bool,
    significand: u128,
    exponent: i32,
    sticky: bool,
}

/// The greatest difference of exponents at which a sum is made without `more`.
const MAX_ALIGNMENT: i32 = 70;

impl UnpackedFloat {
    /// Makes an integer from its sign and magnitude.
    pub fn integer(negative: bool, magnitude: u64) -> Self {
        Self { negative, significand: magnitude.into(), exponent: 0, sticky: false }
    }

    /// Unpacks a float; `None` for infinities and NaN.
    pub fn of<T: RoundTowardZero>(value: T) -> Option<Self> {
        let bits = value.to_word();
        let fraction = bits & ((1 << (T::PRECISION - 1)) - 1);
        let biased = (bits >> (T::PRECISION - 1)) & ((1 << (T::WIDTH - T::PRECISION)) - 1);
        let negative = bits >> (T::WIDTH - 1) != 0;
        if biased == (1 << (T::WIDTH - T::PRECISION)) - 1 {
            return None;
        }
        let (hidden, exponent) = match biased {
            0 => (0, T::MIN_EXPONENT),
            _ => (1 << (T::PRECISION - 1), T::MIN_EXPONENT + biased as i32 - 1),
        };
        Some(Self { negative, significand: u128::from(fraction | hidden), exponent, sticky: false })
    }

    fn negated(self) -> Self {
        Self { negative: !self.negative, ..self }
    }

    /// The sum. A zero sum of numbers of unlike sign is +0.
    fn plus(self, other: Self) -> Self {
        if self.significand == 0 && other.significand == 0 {
            return Self { negative: self.negative && other.negative, ..self };
        }
        if other.significand == 0 {
            return self;
        }
        if self.significand == 0 {
            return other;
        }
        let (high, low) = if self.exponent >= other.exponent { (self, other) } else { (other, self) };
        let same = high.negative == low.negative;
        // Products have 106 bits: they are shifted no further than the headroom allows.
        let headroom = (high.significand.leading_zeros() as i32 - 2).min(MAX_ALIGNMENT);
        let distance = high.exponent - low.exponent;
        if distance > headroom && top_exponent(low) < high.exponent - headroom {
            let significand = high.significand << headroom;
            let significand = if same { significand } else { significand - 1 };
            return Self { significand, exponent: high.exponent - headroom, sticky: true, ..high };
        }
        // The numbers overlap: bits of the lower one that the headroom does not hold go into the
        // sticky bit.
        let shift = distance.min(headroom);
        let lost = distance - shift;
        let a = (high.significand << shift) as i128;
        let inexact = low.significand & ((1u128 << lost) - 1) != 0;
        let b = (low.significand >> lost) as i128;
        let (sum, negative) = match (same, inexact) {
            (true, _) => (a + b, high.negative),
            // a - (b + rest) = (a - b - 1) + (1 - rest), or with the other sign (b - a) + rest
            (false, true) if a > b => (a - b - 1, high.negative),
            (false, _) if a > b => (a - b, high.negative),
            (false, false) if a == b => (0, false),
            (false, _) => (b - a, low.negative),
        };
        Self { negative, significand: sum as u128, exponent: high.exponent - shift, sticky: inexact }
    }

    fn times(self, other: Self) -> Self {
        Self {
            negative: self.negative != other.negative,
            significand: self.significand * other.significand,
            exponent: self.exponent + other.exponent,
            sticky: false,
        }
    }

    /// The quotient; `other` is not 0.
    fn over(self, other: Self) -> Self {
        const SHIFT: i32 = 74;
        // At least 74 + 1 - 53 bits, and with a normal dividend as many as every format has.
        let zeros = self.significand.leading_zeros() as i32 - (128 - 53);
        let dividend = self.significand << (SHIFT + zeros.min(52));
        Self {
            negative: self.negative != other.negative,
            significand: dividend / other.significand,
            exponent: self.exponent - SHIFT - zeros.min(52) - other.exponent,
            sticky: !dividend.is_multiple_of(other.significand),
        }
    }

    /// Truncates the number to a format; what is too large becomes its greatest finite number.
    pub fn truncate<T: RoundTowardZero>(self) -> T {
        let sign = u64::from(self.negative) << (T::WIDTH - 1);
        let (mut significand, mut exponent) = (self.significand, self.exponent);
        let bits = 128 - significand.leading_zeros() as i32;
        if bits == 0 {
            return T::from_word(sign);
        }
        let shift = (bits - T::PRECISION).max(T::MIN_EXPONENT - exponent);
        if shift >= 128 {
            return T::from_word(sign);
        }
        significand = if shift >= 0 { significand >> shift } else { significand << -shift };
        exponent += shift;
        let hidden = 1u128 << (T::PRECISION - 1);
        let biased = if significand >= hidden { (exponent - T::MIN_EXPONENT + 1) as u64 } else { 0 };
        let most = (1 << (T::WIDTH - T::PRECISION)) - 2;
        if biased > most {
            return T::from_word(sign | (most << (T::PRECISION - 1)) | (hidden as u64 - 1));
        }
        let fraction = (significand & (hidden - 1)) as u64;
        T::from_word(sign | biased << (T::PRECISION - 1) | fraction)
    }
}

/// The exponent of the bit above the highest one of a number.
fn top_exponent(number: UnpackedFloat) -> i32 {
    number.exponent + 128 - number.significand.leading_zeros() as i32
}

/// `a + b`; `nearest` is the sum rounded to nearest, the result for infinities and NaN.
pub fn add<T: RoundTowardZero>(a: T, b: T, nearest: T) -> T {
    UnpackedFloat::of(a).zip(UnpackedFloat::of(b)).map_or(nearest, |(a, b)| a.plus(b).truncate())
}

/// `a - b`.
pub fn sub<T: RoundTowardZero>(a: T, b: T, nearest: T) -> T {
    UnpackedFloat::of(a).zip(UnpackedFloat::of(b)).map_or(nearest, |(a, b)| a.plus(b.negated()).truncate())
}

/// `a * b`.
pub fn mul<T: RoundTowardZero>(a: T, b: T, nearest: T) -> T {
    UnpackedFloat::of(a).zip(UnpackedFloat::of(b)).map_or(nearest, |(a, b)| a.times(b).truncate())
}

/// `a / b`.
pub fn div<T: RoundTowardZero>(a: T, b: T, nearest: T) -> T {
    match (UnpackedFloat::of(a), UnpackedFloat::of(b)) {
        (Some(a), Some(b)) if b.significand != 0 => a.over(b).truncate(),
        _ => nearest,
    }
}

/// `a * b + c`, truncated once.
pub fn mul_add<T: RoundTowardZero>(a: T, b: T, c: T, nearest: T) -> T {
    match (UnpackedFloat::of(a), UnpackedFloat::of(b), UnpackedFloat::of(c)) {
        (Some(a), Some(b), Some(c)) => a.times(b).plus(c).truncate(),
        _ => nearest,
    }
}

/// Converts a float to another format.
pub fn convert<T: RoundTowardZero, U: RoundTowardZero>(value: T, nearest: U) -> U {
    UnpackedFloat::of(value).map_or(nearest, UnpackedFloat::truncate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_truncated() {
        let ulp = f32::EPSILON;
        // 1 + (1 - 2^-24) = 2 - 2^-24, which has 25 bits.
        assert_eq!(add(1.0, 1.0 - ulp / 2.0, 2.0f32), 2.0 - ulp);
        assert_eq!(sub(1.0, 1e-30f32, 1.0), 1.0 - ulp / 2.0);
        assert_eq!(sub(-1.0, -1e-30f32, -1.0), -1.0 + ulp / 2.0);
        assert_eq!(add(1.0, 1e-30f32, 1.0), 1.0);
        // (1 + 2^-23)^2 = 1 + 2^-22 + 2^-46
        assert_eq!(mul(1.0 + ulp, 1.0 + ulp, 0.0), 1.0 + 2.0 * ulp);
        assert_eq!(div(2.0f32, 3.0, 0.0).to_bits(), 0x3F2A_AAAA);
        assert_eq!(div(1.0f64, 10.0, 0.0).to_bits(), 0x3FB9_9999_9999_9999);
        // Beyond the greatest number there is none; below the smallest only 0.
        assert_eq!(mul(f32::MAX, 2.0, f32::INFINITY), f32::MAX);
        assert_eq!(mul(f32::MIN_POSITIVE, -f32::MIN_POSITIVE, 0.0).to_bits(), 0x8000_0000);
        // A denormal keeps its bits: (2^-126)(1 - 2^-24) is 2^-126 - 2^-150.
        assert_eq!(mul(f32::MIN_POSITIVE, 1.0 - ulp / 2.0, 0.0).to_bits(), 0x007F_FFFF);
        assert_eq!(sub(1.0f32, 1.0, 0.0).to_bits(), 0);
        assert_eq!(add(-0.0f32, -0.0, 0.0).to_bits(), 0x8000_0000);
        assert!(add(f32::INFINITY, 1.0, f32::INFINITY).is_infinite());
        assert!(div(1.0f32, 0.0, f32::INFINITY).is_infinite());
        assert_eq!(convert::<f32, f16>(65_519.0, f16::INFINITY).to_bits(), 0x7BFF);
        assert_eq!(convert::<f32, f16>(1e9, f16::INFINITY).to_bits(), 0x7BFF);
        assert_eq!(convert::<f64, f32>(0.1, 0.0).to_bits(), 0x3DCC_CCCC);
        assert_eq!(UnpackedFloat::integer(true, 16_777_219).truncate::<f32>(), -16_777_218.0);
        // (1 + 2^-12)^2 - (1 + 2^-11) = 2^-24 exactly, but for one rounding.
        let near = 1.0 + 2f32.powi(-12);
        assert_eq!(mul_add(near, near, -1.0 - 2f32.powi(-11), 0.0), 2f32.powi(-24));
        assert_eq!(mul_add(f64::MAX, 1.0, -1e-300, 0.0), f64::MAX.next_down());
    }

    proptest::proptest! {
        /// Towards zero is at most one step from nearest, and never beyond the exact result: sums
        /// and products of two f32 with like exponents are exact in f64.
        #[test]
        fn it_is_the_exact_result_truncated(a in -1e6f32..1e6, b in -1e6f32..1e6) {
            let truncated = |exact: f64| {
                let near = exact as f32;
                if f64::from(near).abs() > exact.abs() { f32::from_bits(near.to_bits() - 1) } else { near }
            };
            proptest::prop_assert_eq!(mul(a, b, 0.0), truncated(f64::from(a) * f64::from(b)));
            let (x, y) = (a + 3e6, b.abs() + 1e6);
            proptest::prop_assert_eq!(add(x, y, 0.0), truncated(f64::from(x) + f64::from(y)));
            proptest::prop_assert_eq!(sub(x, y, 0.0), truncated(f64::from(x) - f64::from(y)));
        }
    }
}
