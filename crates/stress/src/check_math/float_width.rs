//! The float types of SPIR-V as numbers of bits, and numbers of arbitrary precision.

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;

/// A number of arbitrary precision.
pub type Big = FBig<HalfEven, 2>;

/// A float type of SPIR-V.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FloatWidth {
    /// The format `f16`.
    Half,
    /// The format `f32`.
    Single,
    /// The format `f64`.
    Double,
}

impl FloatWidth {
    /// All formats, from the narrowest.
    pub const ALL: [Self; 3] = [Self::Half, Self::Single, Self::Double];

    /// The number of bits of the format.
    pub fn width(self) -> u32 {
        match self {
            Self::Half => 16,
            Self::Single => 32,
            Self::Double => 64,
        }
    }

    /// Bits of the fraction, and the exponent of the smallest normal number.
    fn shape(self) -> (u32, i32) {
        match self {
            Self::Half => (10, -14),
            Self::Single => (23, -126),
            Self::Double => (52, -1022),
        }
    }

    pub(super) fn sign(self) -> u64 {
        1 << (self.width() - 1)
    }

    /// The bits of positive infinity.
    pub fn infinity(self) -> u64 {
        self.sign() - (1 << self.shape().0)
    }

    /// Decodes a number from its bits.
    pub fn value(self, bits: u64) -> f64 {
        let magnitude = bits & (self.sign() - 1);
        let value = match self {
            Self::Double => f64::from_bits(magnitude),
            Self::Single => f32::from_bits(magnitude as u32).into(),
            _ if magnitude > self.infinity() => f64::NAN,
            _ if magnitude == self.infinity() => f64::INFINITY,
            _ => self.magnitude(magnitude),
        };
        if bits & self.sign() != 0 { -value } else { value }
    }

    /// The number of bits without a sign of a format below f64, as if the exponents went on:
    /// infinity is the power of two behind the largest number.
    pub(super) fn magnitude(self, bits: u64) -> f64 {
        let (fraction, least) = self.shape();
        let biased = (bits >> fraction) as i32;
        let significand = bits & ((1 << fraction) - 1) | u64::from(biased > 0) << fraction;
        significand as f64 * power_of_two(least + (biased - 1).max(0) - fraction as i32)
    }

    /// The bits nearest to a number, ties to even. NaN is one of the NaNs.
    pub fn bits_of(self, value: f64) -> u64 {
        let sign = if value.is_sign_negative() { self.sign() } else { 0 };
        if value.is_nan() {
            return self.infinity() + 1;
        }
        match self {
            Self::Double => value.to_bits(),
            Self::Single => u64::from((value as f32).to_bits()),
            Self::Half => {
                let magnitude = value.abs();
                let exponent = ((magnitude.to_bits() >> 52) as i32 - 1023).max(-14);
                if exponent > 15 {
                    return sign | self.infinity();
                }
                // In units of the last place it is exact; one more than the largest significand
                // carries into the exponent.
                let units = (magnitude * power_of_two(10 - exponent)).round_ties_even() as u64;
                sign | ((((exponent + 14) as u64) << 10) + units)
            }
        }
    }
}

pub(super) fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// A f64 as a number of arbitrary precision.
pub fn big(value: f64) -> Big {
    let exact = Big::try_from(value).expect("a finite number");
    exact.with_precision(PRECISION).value()
}

/// Bits of the evaluations in arbitrary precision. Their values are rounded once to so many.
const PRECISION: usize = 200;
