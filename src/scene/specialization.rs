//! The values of specialization constants.

use crate::error::names::{list_of, nearest};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::math::float_format::FloatFormat;
use crate::module::Module;
use crate::module::scalar_value::{FloatMisfit, ScalarValue, judge_rounding};
use crate::module::ty::Type;
use crate::scene::address_entry::AddressOf;
use crate::scene::addresses::Addresses;
use crate::scene::data::ScalarPiece;
use crate::scene::read::{Parse, Spanned, TomlValue, integer};
use crate::scene::tree::Toml;
use crate::sorted::sort;

/// Which specialization constant a value is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SpecializationKey {
    /// Its `constant_id`.
    Id(u32),
    /// Its name in the source (`OpName`), and where the scene gives it.
    Name(String, Place),
}

impl SpecializationKey {
    /// The key in a scene: a number or a name.
    pub fn of(key: &Spanned<String>) -> Self {
        match key.value.parse() {
            Ok(id) => Self::Id(id),
            Err(_) => Self::Name(key.value.clone(), key.span.place()),
        }
    }

    /// The `constant_id` that it means in a module.
    ///
    /// # Errors
    /// `InvalidScene` where no specialization constant has the name, or several have it.
    pub fn id(&self, module: &Module) -> Result<u32> {
        let (name, place) = match self {
            Self::Id(id) => return Ok(*id),
            Self::Name(name, place) => (name, place),
        };
        let named = |wanted: Option<&str>| {
            let known = module.constants.iter().filter(|constant| constant.specializable);
            let known = known.filter_map(|constant| Some((constant.spec_id?, module.name(constant.id)?)));
            let mut known: Vec<_> =
                known.filter(|(_, name)| wanted.is_none_or(|wanted| *name == wanted)).collect();
            sort(&mut known);
            known.dedup();
            known
        };
        let wrong = |message: String, label: String| {
            Error::new(ErrorKind::InvalidScene, message).at_with(place.clone(), label)
        };
        match named(Some(name))[..] {
            [(id, _)] => Ok(id),
            [] => {
                let known = named(None);
                let near = nearest(name, known.iter().map(|(_, name)| *name));
                let label = near.map_or_else(String::new, |near| format!("did you mean `{near}`?"));
                let error = wrong(format!("the module has no specialization constant named `{name}`"), label);
                let list: Vec<_> = known.iter().map(|(id, name)| format!("{name} ({id})")).collect();
                Err(error.note(match list.is_empty() {
                    true => {
                        "none of its specialization constants has a name: use the `constant_id`".to_owned()
                    }
                    false => format!("available: {}", list_of(list.iter().map(String::as_str))),
                }))
            }
            ref several => {
                let ids: Vec<_> = several.iter().map(|(id, _)| id.to_string()).collect();
                let message = format!("several specialization constants are named `{name}`");
                Err(wrong(message, format!("use one of their ids: {}", ids.join(", "))))
            }
        }
    }
}

/// The value of a specialization constant: `true`, `7`, `0.5`, or with its type `{ u64 = 7 }`.
///
/// A value without a type takes the constant's type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SpecializationValue {
    literal: LiteralValue,
    place: Place,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum LiteralValue {
    Boolean(bool),
    Integer(i128),
    /// A float in decimal, as it is written.
    Float(String),
    /// The value's bytes, little-endian.
    Bytes(Vec<u8>),
    Address(AddressOf),
}

impl Parse for SpecializationValue {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let literal = match value.toml() {
            Toml::Boolean(flag) => LiteralValue::Boolean(*flag),
            Toml::Integer(..) => LiteralValue::Integer(integer(
                value,
                i128::from(i64::MIN),
                i128::from(u64::MAX),
                "i64 or u64",
            )?),
            Toml::Float(text) => LiteralValue::Float(text.clone()),
            Toml::Table(_) => match ScalarPiece::parse(value)? {
                ScalarPiece::Bytes(bytes) => LiteralValue::Bytes(bytes),
                ScalarPiece::Address(of) => LiteralValue::Address(of),
            },
            _ => return value.expected("a number or Boolean"),
        };
        Some(Self { literal, place: value.span().place() })
    }
}

impl SpecializationValue {
    /// Sets a module's specialization constant to the value.
    ///
    /// # Errors
    /// `InvalidArgument` where the module has no such constant, `InvalidScene` where the value is
    /// none of its type.
    pub fn specialize(
        &self,
        module: &mut Module,
        key: &SpecializationKey,
        addresses: Option<&Addresses>,
    ) -> Result<()> {
        let constant = key.id(module)?;
        let address = match (&self.literal, addresses) {
            (LiteralValue::Address(of), Some(addresses)) => {
                Some(LiteralValue::Bytes(addresses.address(of)?.to_le_bytes().to_vec()))
            }
            // Before addresses are given the constant keeps its default.
            (LiteralValue::Address(_), None) => return Ok(()),
            _ => None,
        };
        let literal = address.as_ref().unwrap_or(&self.literal);
        let bits = match module.specialization_type(constant) {
            Some(ty) => {
                let wrong = |why: String| {
                    let message = format!("{why}; constant {constant} is {}", module.describe_type(ty));
                    Error::new(ErrorKind::InvalidScene, message).at(self.place.clone())
                };
                literal.bits(module.ty(ty)).map_err(wrong)?
            }
            None => 0,
        };
        module.specialize_bits(constant, bits).map_err(|error| error.at(self.place.clone()))
    }
}

impl SpecializationValue {
    /// What the value is the address of.
    pub fn target(&self) -> Option<&AddressOf> {
        match &self.literal {
            LiteralValue::Address(of) => Some(of),
            _ => None,
        }
    }
}

impl LiteralValue {
    /// The bits of the value in a type, or why it has none.
    fn bits(&self, ty: &Type) -> std::result::Result<u64, String> {
        let size = match ty {
            Type::Int { width, .. } | Type::Float { width, .. } => width / 8,
            // VkBool32
            _ => 4,
        };
        match (self, ty) {
            (Self::Bytes(bytes), _) if bytes.len() == size as usize => {
                Ok(bytes.iter().rev().fold(0, |bits, &byte| bits << 8 | u64::from(byte)))
            }
            (Self::Bytes(bytes), _) => Err(format!(
                "expected {size} bytes, found {} (VUID-VkSpecializationMapEntry-constantID-00776)",
                bytes.len()
            )),
            (Self::Boolean(flag), Type::Bool) => Ok(u64::from(*flag)),
            (Self::Integer(number @ 0..=1), Type::Bool) => Ok(*number as u64),
            (Self::Integer(number), ty @ Type::Int { .. }) => scalar(*number).bits(ty),
            (Self::Integer(number), ty @ Type::Float { .. }) => {
                let bits = float_bits(&number.to_string(), ty)?;
                let nearest = ty.float_format().unwrap_or(FloatFormat::Binary64).value(bits);
                match nearest as i128 == *number {
                    true => Ok(bits),
                    false => {
                        Err(format!("{number} is not exactly representable: the nearest value is {nearest}"))
                    }
                }
            }
            (Self::Float(text), ty @ Type::Float { .. }) => float_bits(text, ty),
            (Self::Boolean(flag), _) => Err(format!("{flag} is not a number")),
            (Self::Integer(number), _) => Err(format!("{number} is neither true nor false")),
            (Self::Float(text), Type::Bool) => Err(format!("{text} is neither true nor false")),
            (Self::Float(text), _) => Err(format!("{text} is not an integer")),
            (Self::Address(_), _) => Err("the address is not known yet".into()),
        }
    }
}

/// An integer of a scene.
fn scalar(number: i128) -> ScalarValue {
    u64::try_from(number).map_or(ScalarValue::Int(number as i64), ScalarValue::Uint)
}

/// The bits of the float nearest to a decimal, rounded once.
fn float_bits(text: &str, ty: &Type) -> std::result::Result<u64, String> {
    let format = ty.float_format().unwrap_or(FloatFormat::Binary64);
    let wide: f64 = text.parse().map_err(|_| format!("{text} is not a number"))?;
    let bits = match format {
        FloatFormat::Binary32 => text.parse::<f32>().map_or(0, f32::to_bits).into(),
        _ => format.round(wide),
    };
    judge_rounding(wide, bits, format).map_err(|misfit| match misfit {
        FloatMisfit::Overflows => format!("{text} is out of range"),
        FloatMisfit::Vanishes => format!("{text} is too small: it rounds to 0"),
        FloatMisfit::NoInfinity => format!("{text} is not representable: the type has no infinity"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const UINT: Type = Type::Int { width: 32, signed: false };
    const BYTE: Type = Type::Int { width: 8, signed: true };
    const HALF: Type = Type::Float { width: 16, encoding: None };
    const FLOAT: Type = Type::Float { width: 32, encoding: None };
    const DOUBLE: Type = Type::Float { width: 64, encoding: None };
    const BFLOAT: Type = Type::Float { width: 16, encoding: Some(0) };
    const E4M3: Type = Type::Float { width: 8, encoding: Some(4214) };

    fn float_bits(text: &str) -> LiteralValue {
        LiteralValue::Float(text.into())
    }

    #[test]
    fn bare_values_take_the_type_of_the_constant() {
        // 3 = 1.5 * 2^1, so that the mantissa begins with a one.
        assert_eq!(LiteralValue::Integer(3).bits(&UINT), Ok(3));
        assert_eq!(LiteralValue::Integer(3).bits(&HALF), Ok(0x4200));
        assert_eq!(LiteralValue::Integer(3).bits(&FLOAT), Ok(0x4040_0000));
        assert_eq!(LiteralValue::Integer(3).bits(&DOUBLE), Ok(0x4008_0000_0000_0000));
        assert_eq!(LiteralValue::Integer(3).bits(&BFLOAT), Ok(0x4040));
        assert_eq!(float_bits("-3.0").bits(&E4M3), Ok(0xC4)); // 1 1000 100
        assert_eq!(float_bits("0.5").bits(&DOUBLE), Ok(0x3FE0_0000_0000_0000));
        assert_eq!(float_bits("-inf").bits(&FLOAT), Ok(0xFF80_0000));
        // Rounded once: 2^24 + 1 + 2^-40 lies above the middle of two floats, which f64 does not
        // tell.
        assert_eq!(
            float_bits("16777217.0000000000009094947017729282379150390625").bits(&FLOAT),
            Ok(0x4B80_0001)
        );
        assert_eq!(
            (LiteralValue::Integer(-1).bits(&BYTE), LiteralValue::Integer(127).bits(&BYTE)),
            (Ok(0xFF), Ok(0x7F))
        );
        assert_eq!(
            (LiteralValue::Integer(1).bits(&Type::Bool), LiteralValue::Boolean(false).bits(&Type::Bool)),
            (Ok(1), Ok(0))
        );
        assert_eq!(LiteralValue::Bytes(vec![1, 2, 3, 4]).bits(&UINT), Ok(0x0403_0201));
        assert_eq!(LiteralValue::Bytes(vec![0, 0x42]).bits(&HALF), Ok(0x4200));
    }

    #[test]
    fn values_of_no_such_type_say_why() {
        for (literal, ty, why) in [
            (float_bits("2.0"), UINT, "2.0 is not an integer"),
            (LiteralValue::Boolean(true), UINT, "true is not a number"),
            (LiteralValue::Integer(255), BYTE, "255 is out of the range of int8_t, -128 to 127"),
            (LiteralValue::Integer(-129), BYTE, "-129 is out of the range of int8_t, -128 to 127"),
            (LiteralValue::Integer(-1), UINT, "-1 is out of the range of uint, 0 to 4294967295"),
            (
                LiteralValue::Integer(16_777_217),
                FLOAT,
                "16777217 is not exactly representable: the \
                nearest value is 16777216",
            ),
            (float_bits("1e-46"), FLOAT, "1e-46 is too small: it rounds to 0"),
            (LiteralValue::Integer(2), Type::Bool, "2 is neither true nor false"),
            (float_bits("1e39"), FLOAT, "1e39 is out of range"),
            (float_bits("65520.0"), HALF, "65520.0 is out of range"),
            (float_bits("465.0"), E4M3, "465.0 is out of range"),
            (
                LiteralValue::Bytes(vec![0; 8]),
                UINT,
                "expected 4 bytes, found 8 (VUID-VkSpecializationMapEntry-constantID-00776)",
            ),
        ] {
            assert_eq!(literal.bits(&ty), Err(why.to_owned()));
        }
    }
}
