//! The floating-point formats of SPIR-V, and exact conversions between them and `f64`.
//!
//! The IEEE 754 formats are those of `OpTypeFloat` without an `FP Encoding`. The others:
//!
//! * bfloat16 (`SPV_KHR_bfloat16`, "FP Encoding"): "equivalent to the IEEE754 binary32 floating
//!   point encoding but with 16 fewer bits in its significand".
//! * E4M3 and E5M2 (`SPV_EXT_float8`, "FP Encoding") are those of the paper "FP8 Formats for Deep
//!   Learning" (arXiv 2209.05433, table 1). E5M2 follows IEEE 754: bias 15, infinities, NaNs. E4M3
//!   has bias 7 and no infinities: its greatest number is S.1111.110, which is 448, and S.1111.111
//!   is its one NaN of each sign.
//!
//! Denormals are kept. A result that is a NaN is one pattern, positive and quiet.

use half::f16;

use crate::math::float::{f64_to_f16, f64_to_f32_odd};

/// A floating-point format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FloatFormat {
    /// IEEE 754 binary16
    Binary16,
    /// IEEE 754 binary32
    Binary32,
    /// IEEE 754 binary64
    Binary64,
    /// `BFloat16KHR`
    BFloat16,
    /// `Float8E4M3EXT`
    E4M3,
    /// `Float8E5M2EXT`
    E5M2,
}

impl FloatFormat {
    /// Bits of a number.
    pub fn width(self) -> u32 {
        match self {
            Self::E4M3 | Self::E5M2 => 8,
            Self::Binary16 | Self::BFloat16 => 16,
            Self::Binary32 => 32,
            Self::Binary64 => 64,
        }
    }

    /// The number that bits stand for, which is exact.
    pub fn value(self, bits: u64) -> f64 {
        match self {
            Self::Binary16 => f16::from_bits(bits as u16).to_f64(),
            Self::Binary32 => f32::from_bits(bits as u32).into(),
            Self::Binary64 => f64::from_bits(bits),
            Self::BFloat16 => from_bfloat16(bits as u16).into(),
            Self::E4M3 => from_e4m3(bits as u8).into(),
            Self::E5M2 => from_e5m2(bits as u8).into(),
        }
    }

    /// The bits of the nearest number, ties to even, rounded once.
    ///
    /// What lies beyond the range is an infinity; in E4M3, which has none, a NaN.
    pub fn round(self, value: f64) -> u64 {
        match self {
            Self::Binary16 => f64_to_f16(value).to_bits().into(),
            Self::Binary32 => (value as f32).to_bits().into(),
            Self::Binary64 => value.to_bits(),
            Self::BFloat16 => to_bfloat16(f64_to_f32_odd(value)).into(),
            Self::E4M3 => to_e4m3(value).into(),
            Self::E5M2 => to_e5m2(value).into(),
        }
    }

    /// The exponents of the least and of the greatest binade of normal numbers, and the bits of a
    /// significand behind the point.
    pub fn binades(self) -> (i32, i32, i32) {
        match self {
            Self::Binary16 => (-14, 15, 10),
            Self::Binary32 => (-126, 127, 23),
            Self::Binary64 => (-1022, 1023, 52),
            Self::BFloat16 => (-126, 127, 7),
            Self::E4M3 => (-6, 8, 3),
            Self::E5M2 => (-14, 15, 2),
        }
    }
}

/// "The additional significand bits are padded with 0s, producing the exact same value"
/// (`SPV_KHR_bfloat16`, "Conversion Instructions").
#[inline(always)]
pub fn from_bfloat16(bits: u16) -> f32 {
    f32::from_bits(u32::from(bits) << 16)
}

/// The nearest bfloat16, ties to even.
///
/// The extension leaves the rounding mode to the client API; nearest even is that of all other
/// conversions here.
#[inline(always)]
pub fn to_bfloat16(value: f32) -> u16 {
    let bits = value.to_bits();
    // A little less than half of the last place, or half of it where that is odd: the carry runs as
    // far as it must, up to infinity.
    let rounded = bits.wrapping_add(0x7FFF + (bits >> 16 & 1)) >> 16;
    if value.is_nan() { 0x7FC0 } else { rounded as u16 }
}

/// The bfloat16 that a f32 begins with: rounded towards zero.
#[inline(always)]
pub fn to_bfloat16_toward_zero(value: f32) -> u16 {
    if value.is_nan() { 0x7FC0 } else { (value.to_bits() >> 16) as u16 }
}

/// The value of an E4M3 number.
#[inline(always)]
pub fn from_e4m3(bits: u8) -> f32 {
    // The fields in their places of a f32, whose bias is greater by 120; denormals included, as the
    // product with a power of two is exact.
    let magnitude = f32::from_bits(u32::from(bits & 0x7F) << 20) * f32::from_bits((127 + 120) << 23);
    let magnitude = if bits & 0x7F == 0x7F { f32::NAN } else { magnitude };
    if bits & 0x80 == 0 { magnitude } else { -magnitude }
}

/// The value of an E5M2 number.
#[inline(always)]
pub fn from_e5m2(bits: u8) -> f32 {
    let magnitude = f32::from_bits(u32::from(bits & 0x7F) << 21) * f32::from_bits((127 + 112) << 23);
    let magnitude = match bits & 0x7F {
        0x7C => f32::INFINITY,
        0x7D.. => f32::NAN,
        _ => magnitude,
    };
    if bits & 0x80 == 0 { magnitude } else { -magnitude }
}

/// The nearest E4M3 number, ties to even; a NaN for what lies beyond the range.
///
/// "Out-of-range values and infinity ... are converted to NaN if the destination type uses the
/// Float8E4M3EXT FP encoding" (`SPV_EXT_float8`, "Conversion Instructions"). As IEEE 754 does
/// (7.4), the rounded value decides whether one is out of range: 464, the middle of 448 and the 480
/// that would follow, is the last that gives 448.
#[inline(always)]
pub fn to_e4m3(value: f64) -> u8 {
    let magnitude = nearest::<3, 7>(value.abs());
    if magnitude > 0x7E { 0x7F } else { magnitude as u8 | sign(value) }
}

/// [`to_e4m3`] for a conversion decorated `SaturatedToLargestFloat8NormalConversionEXT`: "results
/// in the largest representable normal (i.e. non-infinite) value with a matching sign".
#[inline(always)]
pub fn to_e4m3_saturated(value: f64) -> u8 {
    let magnitude = nearest::<3, 7>(value.abs()).min(0x7E);
    if value.is_nan() { 0x7F } else { magnitude as u8 | sign(value) }
}

/// The nearest E5M2 number, ties to even; "infinity with a matching sign" for what lies beyond the
/// range (`SPV_EXT_float8`, "Conversion Instructions").
#[inline(always)]
pub fn to_e5m2(value: f64) -> u8 {
    let magnitude = nearest::<2, 15>(value.abs()).min(0x7C);
    if value.is_nan() { 0x7E } else { magnitude as u8 | sign(value) }
}

/// [`to_e5m2`] for a conversion decorated `SaturatedToLargestFloat8NormalConversionEXT`.
#[inline(always)]
pub fn to_e5m2_saturated(value: f64) -> u8 {
    let magnitude = nearest::<2, 15>(value.abs()).min(0x7B);
    if value.is_nan() { 0x7E } else { magnitude as u8 | sign(value) }
}

#[inline(always)]
fn sign(value: f64) -> u8 {
    (value.to_bits() >> 56) as u8 & 0x80
}

/// Exponent and significand of the nearest number, ties to even, of a format with so many bits of
/// significand and such a bias, as though its exponents had no end.
#[inline(always)]
fn nearest<const SIGNIFICAND: u32, const BIAS: u64>(magnitude: f64) -> u64 {
    let bits = magnitude.to_bits();
    let lost = 52 - SIGNIFICAND;
    let even = bits >> lost & 1;
    let rounded = (bits + (1 << (lost - 1)) - 1 + even) >> lost;
    let normal = rounded.wrapping_sub((1023 - BIAS) << SIGNIFICAND);
    // Behind 2^52 times the least denormal, the multiples of it lie in a f64's lowest bits. The
    // first one that is normal has the bits that follow those of the denormals.
    let behind = f64::from_bits((1023 + 53 - BIAS - SIGNIFICAND as u64) << 52);
    let denormal = (magnitude + behind).to_bits().wrapping_sub(behind.to_bits());
    if bits < (1024 - BIAS) << 52 { denormal } else { normal }
}

#[cfg(test)]
mod tests;
