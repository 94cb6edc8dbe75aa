//! Scalars that enter from outside, and the one rule by which they become a shader's.
//!
//! * A bool becomes a `bool`.
//! * An integer becomes an integer of any width and sign whose range holds it, or a device address.
//!   In files and languages that write floats without a point, also a float that has the number.
//! * A float becomes a float of any format, rounded once to nearest even. What overflows, and what
//!   is not 0 and rounds to 0, is refused; NaN and infinities stay.

use crate::math::float_format::FloatFormat;
use crate::module::decimal::{judge_rounding, whole_bits};
use crate::module::ty::Type;

/// One scalar, as a value of Rust that a shader's value can be set to.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ScalarValue {
    /// `bool`
    Bool(bool),
    /// A signed integer.
    Int(i64),
    /// An unsigned integer.
    Uint(u64),
    /// `f32`
    Float(f32),
    /// `f64`
    Double(f64),
    /// An integer of a language that writes floats without a point, too: also a float that has it.
    #[doc(hidden)]
    Whole(i128),
}

macro_rules! from {
    ($($ty:ty => $variant:ident;)*) => {$(
        impl From<$ty> for ScalarValue {
            fn from(value: $ty) -> Self {
                Self::$variant(value.into())
            }
        }
    )*};
}

from! {
    bool => Bool;
    u8 => Uint;
    u16 => Uint;
    u32 => Uint;
    u64 => Uint;
    i8 => Int;
    i16 => Int;
    i32 => Int;
    i64 => Int;
    half::f16 => Float;
    half::bf16 => Float;
    f32 => Float;
    f64 => Double;
}

impl From<usize> for ScalarValue {
    fn from(value: usize) -> Self {
        Self::Uint(value as u64)
    }
}

impl ScalarValue {
    /// What it is, for errors.
    #[doc(hidden)]
    pub fn kind(self) -> &'static str {
        match self {
            Self::Bool(_) => "bool",
            Self::Int(_) | Self::Uint(_) | Self::Whole(_) => "integer",
            Self::Float(_) | Self::Double(_) => "float",
        }
    }

    /// The number as text.
    pub(crate) fn text(self) -> String {
        match self {
            Self::Bool(value) => value.to_string(),
            Self::Int(value) => value.to_string(),
            Self::Uint(value) => value.to_string(),
            Self::Float(value) => format!("{value:?}"),
            Self::Double(value) => format!("{value:?}"),
            Self::Whole(value) => value.to_string(),
        }
    }

    /// Its bits in a scalar type of a shader, zero-extended.
    ///
    /// # Errors
    /// Why the type has no such value, in words.
    #[doc(hidden)]
    pub fn bits(self, ty: &Type) -> Result<u64, String> {
        match (ty, self) {
            (Type::Bool, Self::Bool(value)) => Ok(value.into()),
            (&Type::Int { width, signed }, Self::Int(_) | Self::Uint(_) | Self::Whole(_)) => {
                self.integer_bits(width, signed)
            }
            (Type::Pointer { .. }, Self::Int(_) | Self::Uint(_) | Self::Whole(_)) => {
                self.integer_bits(64, false)
            }
            (Type::Float { .. }, Self::Float(_) | Self::Double(_) | Self::Whole(_)) => {
                match ty.float_format() {
                    Some(format) => self.float_bits(format),
                    None => Err(format!("the {} has an unknown encoding", type_name(ty))),
                }
            }
            (Type::Float { .. }, Self::Int(_) | Self::Uint(_)) => {
                Err(format!("{} is an integer, not a float: write `{}.0`", self.text(), self.text()))
            }
            _ => Err(format!("{} is {}, not {}", self.text(), with_article(self.kind()), type_name(ty))),
        }
    }

    /// Its bits as an integer.
    ///
    /// # Errors
    /// Where the range does not hold it, or it is none.
    pub(crate) fn integer_bits(self, width: u32, signed: bool) -> Result<u64, String> {
        let value = match self {
            Self::Int(value) => i128::from(value),
            Self::Uint(value) => i128::from(value),
            Self::Whole(value) => value,
            _ => return Err(format!("{} is {}, not an integer", self.text(), with_article(self.kind()))),
        };
        let (least, most) = match signed {
            true => (-(1i128 << (width - 1)), (1i128 << (width - 1)) - 1),
            false => (0, (1i128 << width) - 1),
        };
        match (least..=most).contains(&value) {
            true => Ok(value as u64 & (u64::MAX >> (64 - width))),
            false => {
                let ty = type_name(&Type::Int { width, signed });
                Err(format!("{value} is out of the range of {ty}, {least} to {most}"))
            }
        }
    }

    /// Its bits as a float, rounded once.
    ///
    /// # Errors
    /// Where it overflows, or is not 0 and rounds to 0, or is no float.
    pub(crate) fn float_bits(self, format: FloatFormat) -> Result<u64, String> {
        let ty = format_name(format);
        let value = match self {
            // The bits of a NaN stay.
            Self::Float(value) if format == FloatFormat::Binary32 => return Ok(value.to_bits().into()),
            Self::Float(value) => f64::from(value),
            Self::Double(value) => value,
            Self::Whole(value) => {
                let digits = value.to_string();
                return whole_bits(&digits, format).map_err(|misfit| misfit.describe(&digits, ty));
            }
            _ => return Err(format!("{} is {}, not a float", self.text(), with_article(self.kind()))),
        };
        judge_rounding(value, format.round(value), format).map_err(|misfit| misfit.describe(&self.text(), ty))
    }
}

/// The name of a scalar type in GLSL.
pub fn type_name(ty: &Type) -> &'static str {
    match ty {
        Type::Bool => "a bool",
        Type::Int { width: 8, signed: true } => "int8_t",
        Type::Int { width: 16, signed: true } => "int16_t",
        Type::Int { width: 32, signed: true } => "int",
        Type::Int { signed: true, .. } => "int64_t",
        Type::Int { width: 8, .. } => "uint8_t",
        Type::Int { width: 16, .. } => "uint16_t",
        Type::Int { width: 32, .. } => "uint",
        Type::Int { .. } => "uint64_t",
        Type::Float { .. } => ty.float_format().map_or("float", format_name),
        Type::Pointer { .. } => "an address",
        _ => "a scalar",
    }
}

/// The name of a float's type in GLSL.
fn format_name(format: FloatFormat) -> &'static str {
    match format {
        FloatFormat::Binary16 => "float16_t",
        FloatFormat::Binary32 => "float",
        FloatFormat::Binary64 => "double",
        FloatFormat::BFloat16 => "bfloat16_t",
        FloatFormat::E4M3 => "floate4m3_t",
        FloatFormat::E5M2 => "floate5m2_t",
    }
}

fn with_article(kind: &str) -> String {
    let article = if kind.starts_with('i') { "an" } else { "a" };
    format!("{article} {kind}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const UINT: Type = Type::Int { width: 32, signed: false };
    const BYTE: Type = Type::Int { width: 8, signed: true };
    const LONG: Type = Type::Int { width: 64, signed: true };
    const HALF: Type = Type::Float { width: 16, encoding: None };
    const FLOAT: Type = Type::Float { width: 32, encoding: None };
    const E4M3: Type = Type::Float { width: 8, encoding: Some(4214) };

    #[test]
    fn values_in_range_have_their_bits() {
        for (value, ty, bits) in [
            (ScalarValue::from(7), UINT, 7),
            (u32::MAX.into(), UINT, 0xFFFF_FFFF),
            ((-128).into(), BYTE, 0x80),
            (127u64.into(), BYTE, 0x7F),
            (i64::MIN.into(), LONG, 1 << 63),
            // 65519.99 is below the middle of 65504 and 65536, which 65520 is.
            (65519.99.into(), HALF, 0x7BFF),
            (f32::INFINITY.into(), HALF, 0x7C00),
            (0.1.into(), FLOAT, 0x3DCC_CCCD),
            (f32::from_bits(0xFFC0_1234).into(), FLOAT, 0xFFC0_1234),
            // Half of the least denormal, 2^-150, is a tie that goes to 0; the next above does not.
            (f64::from_bits(0x3690_0000_0000_0001).into(), FLOAT, 1),
            (true.into(), Type::Bool, 1),
        ] {
            assert_eq!(value.bits(&ty), Ok(bits), "{value:?}");
        }
    }

    #[test]
    fn values_that_a_type_lacks_say_why() {
        for (value, ty, why) in [
            (ScalarValue::from(-1), UINT, "-1 is out of the range of uint, 0 to 4294967295"),
            (128.into(), BYTE, "128 is out of the range of int8_t, -128 to 127"),
            (u64::MAX.into(), LONG, "18446744073709551615 is out of the range of int64_t"),
            (65520.0.into(), HALF, "65520.0 is out of the range of float16_t"),
            (1e300.into(), FLOAT, "1e300 is out of the range of float"),
            (2f64.powi(-150).into(), FLOAT, "is too small for float: it rounds to 0"),
            (f32::INFINITY.into(), E4M3, "floate4m3_t has no infinity"),
            (1.into(), FLOAT, "1 is an integer, not a float: write `1.0`"),
            (0.5.into(), UINT, "0.5 is a float, not uint"),
            (true.into(), UINT, "true is a bool, not uint"),
            (1.into(), Type::Bool, "1 is an integer, not a bool"),
        ] {
            let error = value.bits(&ty).expect_err("no such value");
            assert!(error.contains(why), "{error}");
        }
    }
}
