//! Float controls (`SPV_KHR_float_controls`): denormals flushed to zero, and results cut off
//! towards zero, for each width by itself.
//!
//! What is asked for otherwise (`DenormPreserve`, `RoundingModeRTE`, `SignedZeroInfNanPreserve`,
//! and whatever a fast-math mode would allow to be left out) holds anyway.
//!
//! `DenormFlushToZero` takes denormal operands of arithmetic, comparisons, conversions and
//! `GLSL.std.450` for zeros of their sign, and makes denormal results such zeros. `RoundingModeRTZ`
//! rounds addition, subtraction, multiplication, division, fused multiplication and addition,
//! remainders and conversions, and what the specification derives from them operation by operation.
//! Elementary functions, whose rounding no mode fixes, stay rounded to nearest.
//!
//! `FPRoundingMode` on a conversion stands before the mode of the entry point. The widths are those
//! of IEEE 754's formats: conversions from and to bfloat16 and 8-bit floats heed the modes of the
//! f32 and f64 that they go through.
//!
//! Atomic instructions and image filters are as without these modes. `RoundingModeRTZ` is for
//! "arithmetic and conversion instructions" (SPIR-V 3.6), which they are not: they stand in the
//! sections 3.3.20 and 3.3.10, and Vulkan leaves the arithmetic of a filter to the sampler. A
//! denormal that one of them gives is flushed by the first instruction that calculates with it.
#![allow(clippy::useless_conversion, reason = "a kernel's one formula stands for all its types")]

use half::f16;

use crate::machine::Reg;
use crate::math::float::Float;
use crate::math::toward_zero::{self, RoundTowardZero, UnpackedFloat};
use crate::module::interface::EntryPoint;
use crate::ops::conversion::CONVERT;
use crate::ops::conversion::encoded::Rounding;
use crate::ops::lane_kernel::lane_kernels;
use crate::ops::lane_kernel::{LaneKernel, OpFamily};
use crate::ops::translate::Translator;
use crate::ops::{arithmetic, glsl};
use anyhit_base::error::Result;

/// The widths that an entry point's modes name, as a mask of 16, 32 and 64.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FloatControls {
    /// `DenormFlushToZero`
    flush: u32,
    /// `RoundingModeRTZ`
    toward_zero: u32,
}

impl FloatControls {
    /// The modes of an entry point.
    pub fn of(entry: &EntryPoint) -> Self {
        const DENORM_FLUSH_TO_ZERO: u32 = 4460;
        const ROUNDING_MODE_RTZ: u32 = 4463;
        let widths = |wanted: u32| {
            let modes = entry.modes.iter().filter(|(mode, _)| *mode == wanted);
            modes.filter_map(|(_, operands)| operands.first()).fold(0, |mask, width| mask | width)
        };
        Self { flush: widths(DENORM_FLUSH_TO_ZERO), toward_zero: widths(ROUNDING_MODE_RTZ) }
    }

    /// The modes for one conversion to floats of a width (`FPRoundingMode`).
    pub fn rounding(self, width: u32, rounding: Rounding) -> Self {
        match rounding {
            Rounding::Nearest => Self { toward_zero: self.toward_zero & !width, ..self },
            Rounding::TowardZero => Self { toward_zero: self.toward_zero | width, ..self },
            Rounding::Undecorated | Rounding::Saturated => self,
        }
    }

    /// Whether these controls change the results of a kernel.
    #[inline]
    pub fn affects(self, kernel: &LaneKernel) -> bool {
        self != Self::default() && (self.flushes(kernel) || self.toward_zero & kernel.float_result != 0)
    }

    fn flushes(self, kernel: &LaneKernel) -> bool {
        let floats = kernel.float_operands.iter().fold(kernel.float_result, |mask, width| mask | width);
        self.flush & floats != 0
    }
}

/// Appends a kernel under the translator's float controls.
///
/// # Errors
/// Where there is no room for its result.
pub fn emit_controlled(
    translator: &mut Translator<'_>,
    kernel: &'static LaneKernel,
    from: &[Reg],
) -> Result<Reg> {
    let FloatControls { flush, toward_zero } = translator.float_controls;
    let mut operands: [Reg; 3] = [from.first().copied().unwrap_or(Reg(0)); 3];
    for (at, &reg) in from.iter().enumerate() {
        let width = kernel.float_operands[at];
        operands[at] = if flush & width != 0 { flush_denormal(translator, width, reg)? } else { reg };
    }
    let cut = (toward_zero & kernel.float_result != 0).then(|| toward_zero_counterpart(kernel)).flatten();
    let result = translator.emit_uncontrolled(cut.unwrap_or(kernel), &operands[..from.len()])?;
    match flush & kernel.float_result {
        0 => Ok(result),
        width => flush_denormal(translator, width, result),
    }
}

fn flush_denormal(translator: &mut Translator<'_>, width: u32, reg: Reg) -> Result<Reg> {
    match FlushDenormal.kernel(width) {
        Some(kernel) => translator.emit_uncontrolled(kernel, &[reg]),
        None => Ok(reg),
    }
}

/// The families that round towards zero, each with the one in whose place it is.
static COUNTERPARTS: [(&OpFamily, &OpFamily); 13] = [
    (&FAddTowardZero, &arithmetic::FAdd),
    (&FSubTowardZero, &arithmetic::FSub),
    (&FMulTowardZero, &arithmetic::FMul),
    (&FDivTowardZero, &arithmetic::FDiv),
    (&FmaKHRTowardZero, &arithmetic::FmaKHR),
    (&FRemTowardZero, &arithmetic::FRem),
    (&FModTowardZero, &arithmetic::FMod),
    (&FractTowardZero, &glsl::Fract),
    (&RadiansTowardZero, &glsl::Radians),
    (&DegreesTowardZero, &glsl::Degrees),
    (&FmaTowardZero, &glsl::Fma),
    (&FMixTowardZero, &glsl::FMix),
    (&SmoothStepTowardZero, &glsl::SmoothStep),
];

/// The family of a kernel, or the one in whose place it rounds towards zero.
pub fn rounded_family(kernel: &LaneKernel) -> &'static OpFamily {
    if conversions_toward_zero().any(|family| kernel.is(family)) {
        return &CONVERT;
    }
    COUNTERPARTS.iter().find(|(cut, _)| kernel.is(cut)).map_or(kernel.family, |(_, family)| family)
}

fn conversions_toward_zero() -> impl Iterator<Item = &'static OpFamily> {
    CONVERSIONS.iter().flat_map(|(_, families)| families.iter().copied())
}

/// The kernel that rounds towards zero in the place of one that rounds to nearest.
fn toward_zero_counterpart(kernel: &LaneKernel) -> Option<&'static LaneKernel> {
    if !kernel.is(&CONVERT) {
        let (cut, _) = COUNTERPARTS.iter().find(|(_, family)| kernel.is(family))?;
        return cut.kernels.iter().find(|cut| cut.width == kernel.width);
    }
    let kind = Source::of(kernel);
    let families = CONVERSIONS.iter().filter(|(of, _)| *of == kind).flat_map(|(_, families)| families.iter());
    families
        .flat_map(|family| family.kernels)
        .find(|cut| cut.width == kernel.width && cut.float_result == kernel.float_result)
}

/// What is converted to a float.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Source {
    Signed,
    Unsigned,
    Float,
}

impl Source {
    fn of(kernel: &LaneKernel) -> Self {
        match (kernel.float_operands[0], kernel.signed) {
            (0, true) => Self::Signed,
            (0, false) => Self::Unsigned,
            _ => Self::Float,
        }
    }
}

fn add_rtz<T: RoundTowardZero + std::ops::Add<Output = T>>(a: T, b: T) -> T {
    toward_zero::add(a, b, a + b)
}

fn sub_rtz<T: RoundTowardZero + std::ops::Sub<Output = T>>(a: T, b: T) -> T {
    toward_zero::sub(a, b, a - b)
}

fn mul_rtz<T: RoundTowardZero + std::ops::Mul<Output = T>>(a: T, b: T) -> T {
    toward_zero::mul(a, b, a * b)
}

fn div_rtz<T: RoundTowardZero + std::ops::Div<Output = T>>(a: T, b: T) -> T {
    toward_zero::div(a, b, a / b)
}

lane_kernels! {
    /// Denormals become zeros of their sign.
    FlushDenormal Internal [f16 f32 f64] (a: T) -> T {
        if a.is_denormal() { Float::copysign(T::ZERO, a) } else { a }
    }
    FAddTowardZero Internal [f16 f32 f64] (a: T, b: T) -> T { add_rtz(a, b) }
    FSubTowardZero Internal [f16 f32 f64] (a: T, b: T) -> T { sub_rtz(a, b) }
    FMulTowardZero Internal [f16 f32 f64] (a: T, b: T) -> T { mul_rtz(a, b) }
    FDivTowardZero Internal [f16 f32 f64] (a: T, b: T) -> T { div_rtz(a, b) }
    FmaKHRTowardZero Internal [f16 f32 f64] (a: T, b: T, c: T) -> T {
        toward_zero::mul_add(a, b, c, Float::mul_add(a, b, c))
    }
    FRemTowardZero Internal [f16 f32 f64] (a: T, b: T) -> T {
        sub_rtz(a, mul_rtz(b, Float::trunc(div_rtz(a, b))))
    }
    FModTowardZero Internal [f16 f32 f64] (a: T, b: T) -> T {
        sub_rtz(a, mul_rtz(b, Float::floor(div_rtz(a, b))))
    }
    FractTowardZero Internal [f16 f32 f64] (a: T) -> T { sub_rtz(a, Float::floor(a)) }
    RadiansTowardZero Internal [f16 f32 f64] (a: T) -> T { mul_rtz(a, T::of(std::f64::consts::PI / 180.0)) }
    DegreesTowardZero Internal [f16 f32 f64] (a: T) -> T { mul_rtz(a, T::of(180.0 / std::f64::consts::PI)) }
    FmaTowardZero Internal [f16 f32 f64] (a: T, b: T, c: T) -> T { add_rtz(mul_rtz(a, b), c) }
    FMixTowardZero Internal [f16 f32 f64] (x: T, y: T, a: T) -> T {
        add_rtz(mul_rtz(x, sub_rtz(T::ONE, a)), mul_rtz(y, a))
    }
    SmoothStepTowardZero Internal [f16 f32 f64] (low: T, high: T, x: T) -> T {
        let t = div_rtz(sub_rtz(x, low), sub_rtz(high, low));
        let t = if t < T::ZERO { T::ZERO } else { t };
        let t = if T::ONE < t { T::ONE } else { t };
        let rest = sub_rtz(T::of(3.0), mul_rtz(T::of(2.0), t));
        mul_rtz(mul_rtz(t, t), rest)
    }
}

macro_rules! conversions {
    ($($module:ident $source:ident $name:ident $to:ty: [$($from:ty)*] |$a:ident| $body:expr;)*) => {
        $(mod $module {
            use super::*;
            lane_kernels! { $name Internal [$($from)*] ($a: T) -> $to { $body } }
        })*
        /// Conversions to floats.
        static CONVERSIONS: &[(Source, &[&OpFamily])] = &[$((Source::$source, $module::FAMILIES)),*];
    };
}

conversions! {
    signed16 Signed ConvertSToFTowardZero f16: [i8 i16 i32 i64] |a| UnpackedFloat::integer(a < 0, u64::from(a.unsigned_abs())).truncate();
    signed32 Signed ConvertSToFTowardZero f32: [i8 i16 i32 i64] |a| UnpackedFloat::integer(a < 0, u64::from(a.unsigned_abs())).truncate();
    signed64 Signed ConvertSToFTowardZero f64: [i8 i16 i32 i64] |a| UnpackedFloat::integer(a < 0, u64::from(a.unsigned_abs())).truncate();
    unsigned16 Unsigned ConvertUToFTowardZero f16: [u8 u16 u32 u64] |a| UnpackedFloat::integer(false, u64::from(a)).truncate();
    unsigned32 Unsigned ConvertUToFTowardZero f32: [u8 u16 u32 u64] |a| UnpackedFloat::integer(false, u64::from(a)).truncate();
    unsigned64 Unsigned ConvertUToFTowardZero f64: [u8 u16 u32 u64] |a| UnpackedFloat::integer(false, u64::from(a)).truncate();
    to_half Float FConvertTowardZero f16: [f32 f64] |a| toward_zero::convert(a, crate::math::float::f64_to_f16(f64::from(a)));
    to_single Float FConvertTowardZero f32: [f64] |a| toward_zero::convert(a, a as f32);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::lane_kernel::tests::check;

    #[test]
    fn vectors() {
        let bits = |value: f32| u64::from(value.to_bits());
        check(&FlushDenormal, 32, &[0x807F_FFFF], 0x8000_0000);
        check(&FlushDenormal, 32, &[0x0080_0000], 0x0080_0000);
        check(&FlushDenormal, 16, &[0x03FF], 0);
        check(&FlushDenormal, 64, &[1], 0);
        // 1 + 2^-24 * 3 lies between 1 + 2^-23 and 1 + 2^-22.
        check(&FAddTowardZero, 32, &[bits(1.0), bits(3.0 * 2f32.powi(-24))], bits(1.0 + f32::EPSILON));
        check(&FRemTowardZero, 32, &[bits(-7.0), bits(3.0)], bits(-1.0));
        check(&FModTowardZero, 32, &[bits(-7.0), bits(3.0)], bits(2.0));
        check(&signed32::ConvertSToFTowardZero, 32, &[0x8000_0001], bits(-2_147_483_520.0));
        check(&unsigned32::ConvertUToFTowardZero, 32, &[0xFFFF_FFFF], 0x4F7F_FFFF);
        check(&to_half::FConvertTowardZero, 32, &[bits(65_519.0)], 0x7BFF);
        check(&to_single::FConvertTowardZero, 64, &[0.1f64.to_bits()], 0x3DCC_CCCC);
    }
}
