//! Component types of cooperative vectors and matrices, and conversions of many values at once.
//!
//! Arithmetic uses *wide* words: the bits of an f32 for a float, 32 bits of two's complement for an
//! integer. Every 8- and 16-bit component is exact in its wide word.

use std::fmt;

use half::f16;

use crate::math::float::f64_to_f16;
use crate::math::float_format::{self, FloatFormat};
use crate::math::lane_ops::CpuTier;
use crate::module::ty::Type;

/// A type of the components of a vector or matrix, in registers or in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatrixComponent {
    /// A float.
    Float(FloatFormat),
    /// An integer.
    Int {
        /// Bits: 8, 16 or 32.
        width: u32,
        /// Whether it has a sign.
        signed: bool,
    },
}

impl MatrixComponent {
    /// Signed integers of 32 bits.
    pub const I32: Self = Self::Int { width: 32, signed: true };

    /// The component type of a scalar type whose wide word has 32 bits.
    pub fn of(ty: &Type, signed: bool) -> Option<Self> {
        match *ty {
            Type::Int { width: 64, .. } => None,
            Type::Int { width, .. } => Some(Self::Int { width, signed }),
            _ => match ty.float_format()? {
                FloatFormat::Binary64 => None,
                format => Some(Self::Float(format)),
            },
        }
    }

    /// Bits of a component.
    pub fn width(self) -> u32 {
        match self {
            Self::Float(format) => format.width(),
            Self::Int { width, .. } => width,
        }
    }

    /// Whether it is a float.
    pub fn is_float(self) -> bool {
        matches!(self, Self::Float(_))
    }
}

/// As GLSL names it.
impl fmt::Display for MatrixComponent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Float(FloatFormat::Binary16) => f.write_str("float16_t"),
            Self::Float(FloatFormat::Binary32) => f.write_str("float"),
            Self::Float(FloatFormat::Binary64) => f.write_str("double"),
            Self::Float(FloatFormat::BFloat16) => f.write_str("bfloat16_t"),
            Self::Float(FloatFormat::E4M3) => f.write_str("floate4m3_t"),
            Self::Float(FloatFormat::E5M2) => f.write_str("floate5m2_t"),
            Self::Int { width, signed: true } => write!(f, "int{width}_t"),
            Self::Int { width, signed: false } => write!(f, "uint{width}_t"),
        }
    }
}

/// Converts components, zero-extended to words, to wide words.
pub fn widen(cpu_tier: CpuTier, words: &mut [u32], from: MatrixComponent) {
    cpu_tier.run_loop(
        #[inline(always)]
        || widen_words(words, from),
    );
}

/// Converts components, zero-extended to words, to wide words of another type: to the nearest
/// number of that type, ties to even. A number beyond its range becomes infinite for f16, else the
/// nearest finite number; a NaN becomes 0 as an integer.
pub fn convert(cpu_tier: CpuTier, words: &mut [u32], from: MatrixComponent, to: MatrixComponent) {
    cpu_tier.run_loop(
        #[inline(always)]
        || convert_words(words, from, to),
    );
}

/// Rounds wide words to components, zero-extended to words. Every NaN gets the canonical pattern.
/// Integers keep their low bits.
pub fn narrow(cpu_tier: CpuTier, words: &mut [u32], to: MatrixComponent) {
    cpu_tier.run_loop(
        #[inline(always)]
        || narrow_words(words, to),
    );
}

#[inline(always)]
fn widen_words(words: &mut [u32], from: MatrixComponent) {
    match from {
        MatrixComponent::Float(FloatFormat::Binary16) => {
            for word in words {
                *word = half_to_single(*word);
            }
        }
        MatrixComponent::Float(FloatFormat::BFloat16) => {
            for word in words {
                *word <<= 16;
            }
        }
        MatrixComponent::Float(FloatFormat::E4M3) => {
            for word in words {
                *word = float_format::from_e4m3(*word as u8).to_bits();
            }
        }
        MatrixComponent::Float(FloatFormat::E5M2) => {
            for word in words {
                *word = float_format::from_e5m2(*word as u8).to_bits();
            }
        }
        MatrixComponent::Int { width, signed: true } => {
            for word in words {
                *word = ((*word << (32 - width)) as i32 >> (32 - width)) as u32;
            }
        }
        MatrixComponent::Int { .. }
        | MatrixComponent::Float(FloatFormat::Binary32 | FloatFormat::Binary64) => {}
    }
}

#[inline(always)]
fn convert_words(words: &mut [u32], from: MatrixComponent, to: MatrixComponent) {
    widen_words(words, from);
    if from == to {
        return;
    }
    match (from, to) {
        (MatrixComponent::Float(_), MatrixComponent::Float(format)) => {
            for word in words {
                *word = round_single(f32::from_bits(*word), format);
            }
        }
        (MatrixComponent::Float(_), MatrixComponent::Int { width, signed }) => {
            let (low, high) = range(width, signed);
            for word in words {
                // Both ends are exact in f64, and so is every f32.
                let value = f64::from(f32::from_bits(*word)).round_ties_even();
                *word = value.clamp(low as f64, high as f64) as i64 as u32;
            }
        }
        (MatrixComponent::Int { signed, .. }, MatrixComponent::Float(format)) => {
            for word in words {
                let value = if signed { f64::from(*word as i32) } else { f64::from(*word) };
                *word = match format {
                    FloatFormat::Binary16 => f64_to_f16(value).to_f32().to_bits(),
                    FloatFormat::E4M3 => {
                        float_format::from_e4m3(float_format::to_e4m3_saturated(value)).to_bits()
                    }
                    FloatFormat::E5M2 => {
                        float_format::from_e5m2(float_format::to_e5m2_saturated(value)).to_bits()
                    }
                    _ => (value as f32).to_bits(),
                };
            }
        }
        (MatrixComponent::Int { signed: own, .. }, MatrixComponent::Int { width, signed }) => {
            let (low, high) = range(width, signed);
            for word in words {
                let value = if own { i64::from(*word as i32) } else { i64::from(*word) };
                *word = value.clamp(low, high) as u32;
            }
        }
    }
}

/// The least and the greatest integer of a type.
#[inline(always)]
fn range(width: u32, signed: bool) -> (i64, i64) {
    match signed {
        true => (-1 << (width - 1), (1 << (width - 1)) - 1),
        false => (0, (1 << width) - 1),
    }
}

/// The bits of the number of a format that is nearest to a f32, as a f32.
#[inline(always)]
fn round_single(value: f32, format: FloatFormat) -> u32 {
    match format {
        FloatFormat::Binary16 => half_to_single(single_to_half(value.to_bits())),
        FloatFormat::BFloat16 => u32::from(float_format::to_bfloat16(value)) << 16,
        FloatFormat::E4M3 => float_format::from_e4m3(float_format::to_e4m3_saturated(value.into())).to_bits(),
        FloatFormat::E5M2 => float_format::from_e5m2(float_format::to_e5m2_saturated(value.into())).to_bits(),
        FloatFormat::Binary32 | FloatFormat::Binary64 => value.to_bits(),
    }
}

#[inline(always)]
fn narrow_words(words: &mut [u32], to: MatrixComponent) {
    match to {
        MatrixComponent::Float(FloatFormat::Binary16) => {
            for word in words {
                *word = single_to_half(*word);
            }
        }
        MatrixComponent::Float(FloatFormat::BFloat16) => {
            for word in words {
                *word = float_format::to_bfloat16(f32::from_bits(*word)).into();
            }
        }
        MatrixComponent::Float(FloatFormat::E4M3) => {
            for word in words {
                *word = float_format::to_e4m3(f32::from_bits(*word).into()).into();
            }
        }
        MatrixComponent::Float(FloatFormat::E5M2) => {
            for word in words {
                *word = float_format::to_e5m2(f32::from_bits(*word).into()).into();
            }
        }
        MatrixComponent::Float(FloatFormat::Binary32 | FloatFormat::Binary64) => {
            for word in words {
                *word = if f32::from_bits(*word).is_nan() { f32::NAN.to_bits() } else { *word };
            }
        }
        MatrixComponent::Int { width, .. } => {
            for word in words {
                *word &= u32::MAX >> (32 - width);
            }
        }
    }
}

/// The bits of a f16 as those of a f32, without a branch, so that loops are vectorised.
#[inline(always)]
fn half_to_single(bits: u32) -> u32 {
    // The fields in their places of a f32, whose bias is greater by 112. The product with 2^112 is
    // exact, also for denormals.
    let magnitude = f32::from_bits((bits & 0x7FFF) << 13) * f32::from_bits((127 + 112) << 23);
    let special = if bits & 0x7C00 == 0x7C00 { 0x7F80_0000 } else { 0 };
    magnitude.to_bits() | special | (bits & 0x8000) << 16
}

/// The bits of the f16 nearest to a f32, ties to even, without a branch.
#[inline(always)]
fn single_to_half(bits: u32) -> u32 {
    let (magnitude, sign) = (bits & 0x7FFF_FFFF, bits >> 16 & 0x8000);
    // A little less than half of the last place, or half of it where that is odd; the exponent
    // loses the difference of the biases.
    let rounded = magnitude.wrapping_add(0xFFF + (magnitude >> 13 & 1));
    let normal = (rounded >> 13).wrapping_sub(112 << 10);
    // Beside 0.5, whose last place is 2^-24, the sum has the multiple of 2^-24 in its lowest bits.
    let denormal = (f32::from_bits(magnitude) + 0.5).to_bits().wrapping_sub(0.5f32.to_bits());
    let finite = if magnitude < 113 << 23 { denormal } else { normal.min(0x7C00) };
    let is_nan = magnitude > 0x7F80_0000;
    if is_nan { f16::NAN.to_bits().into() } else { finite | sign }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_is_exact_as_a_single_and_back() {
        for bits in 0..=u16::MAX {
            let expected = f16::from_bits(bits).to_f32();
            let found = f32::from_bits(half_to_single(bits.into()));
            assert!(
                found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan(),
                "{bits:#x}"
            );
            let back = if expected.is_nan() { 0x7E00 } else { bits };
            assert_eq!(single_to_half(found.to_bits()), u32::from(back), "{bits:#x}");
        }
    }

    #[test]
    fn singles_round_to_the_nearest_half() {
        // Every pattern of the upper bits with lower bits around ties.
        for upper in 0..1u32 << 19 {
            for lower in [0, 1, 0x0FFF, 0x1000, 0x1001, 0x1FFF] {
                let bits = upper << 13 | lower;
                let half = f16::from_f32(f32::from_bits(bits));
                let expected = if half.is_nan() { 0x7E00 } else { half.to_bits() };
                assert_eq!(single_to_half(bits), u32::from(expected), "{bits:#x}");
            }
        }
    }

    #[test]
    fn conversions_round_and_saturate() {
        let converted = |word: u32, from, to| {
            let mut words = [word];
            convert(CpuTier::new(), &mut words, from, to);
            words[0]
        };
        let single = MatrixComponent::Float(FloatFormat::Binary32);
        let half = MatrixComponent::Float(FloatFormat::Binary16);
        let int = |width, signed| MatrixComponent::Int { width, signed };
        let of_single = |value: f32, to| converted(value.to_bits(), single, to) as i32;
        assert_eq!(of_single(2.5, int(8, true)), 2);
        assert_eq!(of_single(-3.5, int(8, true)), -4);
        assert_eq!(of_single(-200.0, int(8, true)), -128);
        assert_eq!(of_single(300.0, int(8, false)), 255);
        assert_eq!(of_single(-0.6, int(8, false)), 0);
        assert_eq!(of_single(f32::NAN, int(8, true)), 0);
        assert_eq!(of_single(3e9, int(32, true)), i32::MAX);
        assert_eq!(of_single(3e9, int(32, false)) as u32, 3_000_000_000);
        assert_eq!(converted(0x80, int(8, true), int(8, false)), 0);
        assert_eq!(converted(0xFFFF_FF00, int(32, true), int(8, true)) as i32, -128);
        assert_eq!(converted(0xFFFF_FF00, int(32, false), int(8, true)), 127);
        assert_eq!(converted(70_000, int(32, false), half), f32::INFINITY.to_bits());
        // 2^11 + 1 lies between two f16: to even.
        assert_eq!(converted(2049, int(32, true), half), 2048f32.to_bits());
        // 16_777_217 = 2^24 + 1 likewise between two f32.
        assert_eq!(converted(16_777_217, int(32, true), single), 16_777_216f32.to_bits());
        // E4M3 ends at 448, E5M2 at 57344.
        let e4m3 = MatrixComponent::Float(FloatFormat::E4M3);
        let e5m2 = MatrixComponent::Float(FloatFormat::E5M2);
        assert_eq!(converted(1e6f32.to_bits(), single, e4m3), 448f32.to_bits());
        assert_eq!(converted((-1e6f32).to_bits(), single, e5m2), (-57344f32).to_bits());
        // 1.0625 = 1 + 2^-4 is a tie of E4M3, whose significands have three bits: to even.
        assert_eq!(converted(1.0625f32.to_bits(), single, e4m3), 1f32.to_bits());
    }

    #[test]
    fn narrow_integers_keep_low_bits_and_nans_are_canonical() {
        let mut words = [0xFFFF_FF85];
        narrow(CpuTier::new(), &mut words, MatrixComponent::Int { width: 8, signed: true });
        assert_eq!(words, [0x85]);
        let mut words = [0xFFC0_0001];
        narrow(CpuTier::new(), &mut words, MatrixComponent::Float(FloatFormat::Binary32));
        assert_eq!(words, [0x7FC0_0000]);
    }
}
