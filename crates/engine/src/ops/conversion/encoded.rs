//! Conversions from and to bfloat16 and 8-bit floats, by way of IEEE 754's formats.
//!
//! "Conversions to or from floating-point values with the BFloat16KHR encoding first convert the
//! source value to IEEE754 binary32, and then from IEEE754 binary32 to the target format"
//! (`SPV_KHR_bfloat16`, "Conversion Instructions"): so a double is rounded twice.
//!
//! 8-bit floats are exact in f32. What becomes one is rounded once: f64 holds every integer that
//! lies within their range, and so near to it that rounding could bring it inside.
#![allow(clippy::useless_conversion, reason = "a kernel's one formula stands for all its types")]

use crate::machine::Reg;
use crate::math::float_format::{self, FloatFormat};
use crate::module::Id;
use crate::module::check_encoding::SATURATED;
use crate::ops::conversion::{Conversion, kernel};
use crate::ops::lane_kernel::OpFamily;
use crate::ops::lane_kernel::lane_kernels;
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

lane_kernels! {
    /// A bfloat16 as f32.
    FromBFloat16 Internal [u16] (a: T) -> f32 { float_format::from_bfloat16(a) }
    /// An E4M3 float as f32.
    FromE4M3 Internal [u8] (a: T) -> f32 { float_format::from_e4m3(a) }
    /// An E5M2 float as f32.
    FromE5M2 Internal [u8] (a: T) -> f32 { float_format::from_e5m2(a) }
    /// To the nearest bfloat16.
    ToBFloat16 Internal [f32] (a: T) -> u16 { float_format::to_bfloat16(a) }
    /// To the bfloat16 that a f32 begins with.
    ToBFloat16TowardZero Internal [f32] (a: T) -> u16 { float_format::to_bfloat16_toward_zero(a) }
    /// To the nearest E4M3 float.
    ToE4M3 Internal [f32 f64] (a: T) -> u8 { float_format::to_e4m3(f64::from(a)) }
    /// To the nearest finite E4M3 float.
    ToE4M3Saturated Internal [f32 f64] (a: T) -> u8 { float_format::to_e4m3_saturated(f64::from(a)) }
    /// To the nearest E5M2 float.
    ToE5M2 Internal [f32 f64] (a: T) -> u8 { float_format::to_e5m2(f64::from(a)) }
    /// To the nearest finite E5M2 float.
    ToE5M2Saturated Internal [f32 f64] (a: T) -> u8 { float_format::to_e5m2_saturated(f64::from(a)) }
}

/// How a conversion rounds, as its decorations say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    /// As the entry point's modes say, or to nearest even.
    Undecorated,
    /// `FPRoundingMode RTE`
    Nearest,
    /// `FPRoundingMode RTZ`
    TowardZero,
    /// `SaturatedToLargestFloat8NormalConversionEXT`
    Saturated,
}

impl Rounding {
    /// What decorates a result.
    ///
    /// # Errors
    /// `InvalidModule` for a mode that Vulkan does not have.
    pub fn of(translator: &Translator<'_>, result: Option<Id>) -> Result<Self> {
        const FP_ROUNDING_MODE: u32 = 39;
        let Some(id) = result else { return Ok(Self::Undecorated) };
        if translator.module.decorations.find(id, SATURATED).is_some() {
            return Ok(Self::Saturated);
        }
        match translator.module.decorations.literal(id, FP_ROUNDING_MODE) {
            None => Ok(Self::Undecorated),
            Some(0) => Ok(Self::Nearest),
            Some(1) => Ok(Self::TowardZero),
            Some(mode) => {
                let vuid = "VUID-StandaloneSpirv-FPRoundingMode-04675";
                Err(translator.invalid(format!("FPRoundingMode {mode} is neither RTE nor RTZ ({vuid})")))
            }
        }
    }
}

/// Converts a value to the IEEE 754 format in which its arithmetic is done; also gives that
/// format's bits.
///
/// # Errors
/// Where there is no room for the result.
pub fn widen(translator: &mut Translator<'_>, format: FloatFormat, value: Reg) -> Result<(Reg, u32)> {
    let (family, width): (&OpFamily, u32) = match format {
        FloatFormat::BFloat16 => (&FromBFloat16, 16),
        FloatFormat::E4M3 => (&FromE4M3, 8),
        FloatFormat::E5M2 => (&FromE5M2, 8),
        _ => return Ok((value, format.width())),
    };
    Ok((translator.emit_family(family, width, &[value])?, 32))
}

/// Converts a value of a type of `from` bits to a float format.
///
/// # Errors
/// `UnsupportedModule` where there is no such conversion.
pub fn narrow(
    translator: &mut Translator<'_>,
    conversion: Conversion,
    from: u32,
    format: FloatFormat,
    rounding: Rounding,
    value: Reg,
) -> Result<Reg> {
    let float = conversion == Conversion::F;
    let exact = if float && from < 64 { 32 } else { 64 };
    let (family, through): (&OpFamily, u32) = match (format, rounding) {
        (FloatFormat::BFloat16, Rounding::TowardZero) => (&ToBFloat16TowardZero, 32),
        (FloatFormat::BFloat16, _) => (&ToBFloat16, 32),
        (FloatFormat::E4M3, Rounding::Saturated) => (&ToE4M3Saturated, exact),
        (FloatFormat::E4M3, _) => (&ToE4M3, exact),
        (FloatFormat::E5M2, Rounding::Saturated) => (&ToE5M2Saturated, exact),
        (FloatFormat::E5M2, _) => (&ToE5M2, exact),
        _ => return emit_conversion(translator, conversion, from, format.width(), value),
    };
    let value = emit_conversion(translator, conversion, from, through, value)?;
    translator.emit_family(family, through, &[value])
}

/// Appends a conversion between two widths, if they differ.
///
/// # Errors
/// `UnsupportedModule` where there is no such conversion.
pub fn emit_conversion(
    translator: &mut Translator<'_>,
    conversion: Conversion,
    from: u32,
    to: u32,
    value: Reg,
) -> Result<Reg> {
    match kernel(conversion, from, to) {
        Some(kernel) => translator.emit_kernel(kernel, &[value]),
        None if from == to => Ok(value),
        None => {
            Err(translator.unsupported(format!("a conversion from {from} to {to} bits is not supported")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::lane_kernel::tests::check;

    #[test]
    fn vectors() {
        let bits = |value: f32| u64::from(value.to_bits());
        check(&FromBFloat16, 16, &[0xBFC0], bits(-1.5));
        check(&FromBFloat16, 16, &[0x0001], 0x0001_0000); // 2^-133 is 2^16 of the least f32
        // A NaN is one pattern, whatever it was.
        check(&FromBFloat16, 16, &[0xFF81], 0x7FC0_0000);
        check(&FromE4M3, 8, &[0xFF], 0x7FC0_0000);
        check(&FromE4M3, 8, &[0x7E], bits(448.0));
        check(&FromE5M2, 8, &[0xFC], bits(f32::NEG_INFINITY));
        check(&FromE5M2, 8, &[0x01], bits(2f32.powi(-16)));
        check(&ToBFloat16, 32, &[bits(f32::MAX)], 0x7F80);
        check(&ToBFloat16, 32, &[0xFF80_0001], 0x7FC0);
        check(&ToBFloat16, 32, &[0xBF80_8000], 0xBF80); // -(1 + 2^-8), a tie
        check(&ToBFloat16TowardZero, 32, &[0xBF80_FFFF], 0xBF80);
        check(&ToBFloat16TowardZero, 32, &[bits(f32::MAX)], 0x7F7F);
        check(&ToBFloat16TowardZero, 32, &[0x7F80_0001], 0x7FC0);
        check(&ToE4M3, 32, &[bits(465.0)], 0x7F);
        check(&ToE4M3Saturated, 32, &[bits(-465.0)], 0xFE);
        check(&ToE4M3, 64, &[(0.5f64 + 2f64.powi(-5) + 2f64.powi(-50)).to_bits()], 0x31);
        check(&ToE5M2, 32, &[bits(-70_000.0)], 0xFC);
        check(&ToE5M2Saturated, 64, &[f64::INFINITY.to_bits()], 0x7B);
    }

    #[test]
    fn every_code_of_a_small_format_at_every_width() {
        let formats = [
            (&FromBFloat16, FloatFormat::BFloat16),
            (&FromE4M3, FloatFormat::E4M3),
            (&FromE5M2, FloatFormat::E5M2),
        ];
        for (family, format) in formats {
            for code in 0..1u64 << format.width() {
                let value = format.value(code) as f32;
                let expected = if value.is_nan() { 0x7FC0_0000 } else { value.to_bits() };
                check(family, format.width(), &[code], expected.into());
            }
        }
    }
}
