//! The functions under test, and independent evaluations of them.

use dashu_float::Context;
use dashu_float::round::mode::HalfEven;

use crate::check_math::float_width::{Big, FloatWidth, big};
use anyhit_engine::ops::conversion::Conversion;
use anyhit_engine::ops::lane_kernel::{LaneKernel, OpFamily};
use anyhit_engine::ops::{arithmetic, conversion, glsl};

/// An evaluation in f64.
type Estimate = fn(f64) -> f64;
/// An evaluation in f64 of two operands.
type EstimateOfTwo = fn(f64, f64) -> f64;

/// How the reference value of a function is computed.
#[derive(Clone, Copy, Debug)]
pub enum ReferenceValue {
    /// The f64 is exact, or so near that rounding it once more is rounding once.
    Rounded(Estimate),
    /// [`Self::Rounded`] for a function of two operands.
    RoundedPair(EstimateOfTwo),
    /// A f64 with an error, and a value in arbitrary precision for finite operands where that is
    /// not enough.
    Elementary(Estimate, fn(&Big) -> Big),
    /// [`Self::Elementary`] for a function of two operands.
    ElementaryPair(EstimateOfTwo, fn(&Big, &Big) -> Big),
    /// The integer part, as an integer of so many bits with or without sign: the nearest one where
    /// the type does not hold it, and 0 for a NaN.
    Integer {
        /// `OpConvertFToS`, not `OpConvertFToU`.
        signed: bool,
        /// Bits of the integer.
        bits: u32,
    },
}

/// A function under test.
#[derive(Debug)]
pub struct CheckedFunction {
    /// The specification's name, and behind it the type of an integer result.
    pub name: &'static str,
    kernels: Kernels,
    /// How the correct results are computed.
    pub reference: ReferenceValue,
}

/// The kernels that are judged.
#[derive(Debug)]
enum Kernels {
    /// The kernel of each width.
    Family(&'static OpFamily),
    /// The conversions to an integer of so many bits.
    Conversion(Conversion, u32),
}

impl CheckedFunction {
    /// The kernel for floats of this format.
    pub fn kernel(&self, format: FloatWidth) -> Option<&'static LaneKernel> {
        match self.kernels {
            Kernels::Family(family) => {
                family.kernel(format.width()).filter(|kernel| kernel.float_result == format.width())
            }
            Kernels::Conversion(conversion, bits) => conversion::kernel(conversion, format.width(), bits),
        }
    }

    /// Its name without the type of its result.
    pub fn instruction(&self) -> &'static str {
        self.name.split(' ').next().unwrap_or(self.name)
    }

    /// Whether it is judged at this width.
    pub fn exists(&self, format: FloatWidth) -> bool {
        let exact = matches!(self.reference, ReferenceValue::Rounded(_) | ReferenceValue::RoundedPair(_));
        let pair = matches!(self.reference, ReferenceValue::RoundedPair(_));
        self.kernel(format).is_some()
            && (!exact || format == FloatWidth::Half || (format == FloatWidth::Single && !pair))
    }
}

const fn rounded(family: &'static OpFamily, value: Estimate) -> CheckedFunction {
    CheckedFunction {
        name: family.name,
        kernels: Kernels::Family(family),
        reference: ReferenceValue::Rounded(value),
    }
}

const fn rounded_pair(family: &'static OpFamily, value: EstimateOfTwo) -> CheckedFunction {
    CheckedFunction {
        name: family.name,
        kernels: Kernels::Family(family),
        reference: ReferenceValue::RoundedPair(value),
    }
}

const fn elementary(
    family: &'static OpFamily,
    estimate: Estimate,
    precise: fn(&Big) -> Big,
) -> CheckedFunction {
    CheckedFunction {
        name: family.name,
        kernels: Kernels::Family(family),
        reference: ReferenceValue::Elementary(estimate, precise),
    }
}

const fn elementary_pair(
    family: &'static OpFamily,
    estimate: EstimateOfTwo,
    precise: fn(&Big, &Big) -> Big,
) -> CheckedFunction {
    CheckedFunction {
        name: family.name,
        kernels: Kernels::Family(family),
        reference: ReferenceValue::ElementaryPair(estimate, precise),
    }
}

const fn to_signed(name: &'static str, bits: u32) -> CheckedFunction {
    CheckedFunction {
        name,
        kernels: Kernels::Conversion(Conversion::FToS, bits),
        reference: ReferenceValue::Integer { signed: true, bits },
    }
}

const fn to_unsigned(name: &'static str, bits: u32) -> CheckedFunction {
    CheckedFunction {
        name,
        kernels: Kernels::Conversion(Conversion::FToU, bits),
        reference: ReferenceValue::Integer { signed: false, bits },
    }
}

/// Every function, in the order of the specification.
pub static FUNCTIONS: &[CheckedFunction] = &[
    rounded(&arithmetic::FNegate, |a| -a),
    rounded_pair(&arithmetic::FAdd, |a, b| a + b),
    rounded_pair(&arithmetic::FSub, |a, b| a - b),
    rounded_pair(&arithmetic::FMul, |a, b| a * b),
    rounded_pair(&arithmetic::FDiv, |a, b| a / b),
    to_unsigned("ConvertFToU u8", 8),
    to_unsigned("ConvertFToU u16", 16),
    to_unsigned("ConvertFToU u32", 32),
    to_unsigned("ConvertFToU u64", 64),
    to_signed("ConvertFToS i8", 8),
    to_signed("ConvertFToS i16", 16),
    to_signed("ConvertFToS i32", 32),
    to_signed("ConvertFToS i64", 64),
    rounded(&conversion::QuantizeToF16, quantized),
    rounded(&glsl::Round, |a| trunc(a + 0.5f64.copysign(a)).copysign(a)),
    rounded(&glsl::RoundEven, round_even),
    rounded(&glsl::Trunc, trunc),
    rounded(&glsl::FAbs, |a| if a.is_sign_negative() { -a } else { a }),
    rounded(&glsl::FSign, |a| if a == 0.0 || a.is_nan() { a } else { 1f64.copysign(a) }),
    rounded(&glsl::Floor, floor),
    rounded(&glsl::Ceil, |a| -floor(-a)),
    rounded(&glsl::Fract, |a| a - floor(a)),
    elementary(&glsl::Sin, f64::sin, |a| a.sin()),
    elementary(&glsl::Cos, f64::cos, |a| a.cos()),
    elementary(&glsl::Tan, f64::tan, |a| a.tan()),
    elementary(&glsl::Asin, f64::asin, |a| a.asin()),
    elementary(&glsl::Acos, f64::acos, |a| a.acos()),
    elementary(&glsl::Atan, f64::atan, |a| a.atan()),
    elementary(&glsl::Sinh, f64::sinh, |a| a.sinh()),
    elementary(&glsl::Cosh, f64::cosh, |a| a.cosh()),
    elementary(&glsl::Tanh, f64::tanh, |a| a.tanh()),
    elementary(&glsl::Asinh, asinh, |a| a.asinh()),
    elementary(&glsl::Acosh, acosh, |a| a.acosh()),
    elementary(&glsl::Atanh, atanh, |a| a.atanh()),
    elementary_pair(&glsl::Atan2, f64::atan2, atan2),
    elementary_pair(&glsl::Pow, power, pow),
    elementary(&glsl::Exp, f64::exp, |a| a.exp()),
    elementary(&glsl::Log, f64::ln, |a| a.ln()),
    elementary(&glsl::Exp2, f64::exp2, |a| (a * wide(2.0).ln()).exp()),
    elementary(&glsl::Log2, f64::log2, |a| a.log2()),
    elementary(&glsl::Sqrt, f64::sqrt, |a| a.sqrt()),
    elementary(&glsl::InverseSqrt, |a| 1.0 / a.sqrt(), |a| big(1.0) / a.sqrt()),
];

/// A number with more bits, as it multiplies a large one.
fn wide(value: f64) -> Big {
    Context::<HalfEven>::new(300).convert_int::<2>((value as i32).into()).value()
}

/// The arc tangent of a small positive quotient q is q - q^3 / 3 + ..., less than q by more than
/// all the bits show: for f32 as little as 2^-556 of it. It is made a little less here, as a
/// quotient may lie in the middle of two numbers and the arc tangent never does.
fn atan2(y: &Big, x: &Big) -> Big {
    let angle = y.atan2(x);
    let size = if angle < Big::ZERO { -angle.clone() } else { angle.clone() };
    if size < big(2.0).powi((-60).into()) {
        angle.clone() - angle * big(2.0).powi((-120).into())
    } else {
        angle
    }
}

/// The power in f64: 1 even of a signalling NaN, for which the platform's power is a NaN.
fn power(a: f64, b: f64) -> f64 {
    if a == 1.0 || b == 0.0 { 1.0 } else { a.powf(b) }
}

/// A power of a positive number; of a negative one where the exponent is an integer, or there is
/// none.
fn pow(a: &Big, b: &Big) -> Big {
    if *a < Big::ZERO {
        let size = pow(&-a.clone(), b);
        let odd = (b.clone() / big(2.0)).floor() * big(2.0) != *b;
        return if odd { -size } else { size };
    }
    let a = a.clone().with_precision(300).value();
    (b * a.ln()).exp().with_precision(200).value()
}

/// Rounds towards zero. Beyond 2^52 every f64 is an integer; an infinity or a NaN stays as it is.
fn trunc(a: f64) -> f64 {
    if a.abs() < 4_503_599_627_370_496.0 { (a as i64 as f64).copysign(a) } else { a }
}

fn floor(a: f64) -> f64 {
    let towards_zero = trunc(a);
    if towards_zero > a { towards_zero - 1.0 } else { towards_zero }
}

fn round_even(a: f64) -> f64 {
    let below = floor(a);
    let rest = a - below;
    let odd = trunc(below / 2.0) * 2.0 != below;
    let up = rest > 0.5 || (rest == 0.5 && odd);
    if up { (below + 1.0).copysign(a) } else { below.copysign(a) }
}

/// The nearest f16 without denormals.
fn quantized(a: f64) -> f64 {
    let half = FloatWidth::Half.value(FloatWidth::Half.bits_of(a));
    // 2^-14
    if half.abs() < 1.0 / 16_384.0 { 0f64.copysign(a) } else { half }
}

/// From here on the square root of a^2 + 1 or a^2 - 1 is a itself.
const LARGE: f64 = 134_217_728.0;

fn asinh(a: f64) -> f64 {
    let size = a.abs();
    let value = if size > LARGE {
        size.ln() + std::f64::consts::LN_2
    } else {
        (size + size * size / (1.0 + (size * size + 1.0).sqrt())).ln_1p()
    };
    value.copysign(a)
}

fn acosh(a: f64) -> f64 {
    let more = a - 1.0;
    if a < 1.0 {
        f64::NAN
    } else if a > LARGE {
        a.ln() + std::f64::consts::LN_2
    } else {
        (more + (more * (more + 2.0)).sqrt()).ln_1p()
    }
}

fn atanh(a: f64) -> f64 {
    let size = a.abs();
    (0.5 * (2.0 * size / (1.0 - size)).ln_1p()).copysign(a)
}
