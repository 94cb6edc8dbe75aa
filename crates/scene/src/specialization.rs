//! The values of specialization constants.

use crate::address_entry::AddressOf;
use crate::addresses::Addresses;
use crate::data::ScalarPiece;
use crate::read::{Parse, Spanned, TomlValue};
use crate::scalar::Scalar;
use crate::tree::Toml;
use anyhit_base::error::names::{list_of, nearest};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::sorted::sort;
use anyhit_engine::math::float_format::FloatFormat;
use anyhit_engine::module::Module;
use anyhit_engine::module::decimal::{decimal_bits, whole_bits};
use anyhit_engine::module::scalar_value::{ScalarValue, type_name};
use anyhit_engine::module::ty::Type;

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

/// The value of a specialization constant: `true`, `7`, `0.5`, or with its type `{ u64 = 7 }`; of
/// constant data (`SPV_KHR_constant_data`) a text.
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
    /// Digits with their sign, and their base.
    Integer(String, u32),
    /// A float in decimal, as it is written.
    Float(String),
    /// The value's bytes, little-endian, and their type where one is given.
    Bytes(Vec<u8>, Option<Scalar>),
    Address(AddressOf),
    Text(String),
}

impl Parse for SpecializationValue {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let literal = match value.toml() {
            Toml::Boolean(flag) => LiteralValue::Boolean(*flag),
            Toml::Integer(digits, base) => LiteralValue::Integer(digits.to_string(), *base),
            Toml::Float(text) => LiteralValue::Float(text.to_string()),
            Toml::String(text) => LiteralValue::Text(text.to_string()),
            Toml::Table(_) => match ScalarPiece::parse(value)? {
                ScalarPiece::Bytes(bytes, scalar) => LiteralValue::Bytes(bytes, scalar),
                ScalarPiece::Address(of) => LiteralValue::Address(of),
            },
            _ => return value.expected("a number, a Boolean or a string"),
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
                Some(LiteralValue::Bytes(addresses.address(of)?.to_le_bytes().to_vec(), None))
            }
            // Before addresses are given the constant keeps its default.
            (LiteralValue::Address(_), None) => return Ok(()),
            _ => None,
        };
        let literal = address.as_ref().unwrap_or(&self.literal);
        if module.specializes_data(constant)
            && let LiteralValue::Text(text) = literal
        {
            return module.specialize_data(constant, text.as_bytes());
        }
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
        let format = ty.float_format().unwrap_or(FloatFormat::Binary64);
        match (self, ty) {
            (Self::Bytes(bytes, scalar), _) if bytes.len() == size as usize => {
                let bits = bytes.iter().rev().fold(0, |bits, &byte| bits << 8 | u64::from(byte));
                match scalar.filter(|scalar| bits != 0 && !scalar.fits(bits, ty)) {
                    None => Ok(bits),
                    Some(scalar) => {
                        Err(format!("the {} {} is not {}", scalar.name(), scalar.text(bits), type_name(ty)))
                    }
                }
            }
            (Self::Bytes(bytes, _), _) => Err(format!(
                "expected {size} bytes, found {} (VUID-VkSpecializationMapEntry-constantID-00776)",
                bytes.len()
            )),
            (Self::Boolean(flag), Type::Bool) => Ok(u64::from(*flag)),
            (Self::Integer(digits, base), Type::Int { .. }) => match i128::from_str_radix(digits, *base) {
                Ok(number) => ScalarValue::Whole(number).bits(ty),
                Err(_) => Err(format!("{digits} is out of the range of {}", type_name(ty))),
            },
            (Self::Integer(digits, 10), Type::Float { .. }) => {
                whole_bits(digits, format).map_err(|misfit| misfit.describe(digits, type_name(ty)))
            }
            (Self::Integer(..), Type::Float { .. }) => {
                Err("write a float in decimal, or its bits as `{ hex = \"...\" }`".to_owned())
            }
            (Self::Float(text), Type::Float { .. }) => {
                decimal_bits(text, format).map_err(|misfit| misfit.describe(text, type_name(ty)))
            }
            (Self::Boolean(flag), _) => Err(format!("{flag} is not a number")),
            (Self::Integer(digits, _), _) => Err(match &**digits {
                "0" => "0 is neither true nor false: write `false`".to_owned(),
                "1" => "1 is neither true nor false: write `true`".to_owned(),
                other => format!("{other} is neither true nor false"),
            }),
            (Self::Float(text), Type::Bool) => Err(format!("{text} is neither true nor false")),
            (Self::Float(text), _) => Err(format!("{text} is not an integer")),
            (Self::Address(_), _) => Err("the address is not known yet".into()),
            (Self::Text(text), _) => Err(format!("`{text}` is not a number")),
        }
    }
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

    fn integer(number: i128) -> LiteralValue {
        LiteralValue::Integer(number.to_string(), 10)
    }

    fn float_bits(text: &str) -> LiteralValue {
        LiteralValue::Float(text.into())
    }

    #[test]
    fn bare_values_take_the_type_of_the_constant() {
        // 3 = 1.5 * 2^1, so that the mantissa begins with a one.
        assert_eq!(integer(3).bits(&UINT), Ok(3));
        assert_eq!(integer(3).bits(&HALF), Ok(0x4200));
        assert_eq!(integer(3).bits(&FLOAT), Ok(0x4040_0000));
        assert_eq!(integer(3).bits(&DOUBLE), Ok(0x4008_0000_0000_0000));
        assert_eq!(integer(3).bits(&BFLOAT), Ok(0x4040));
        assert_eq!(float_bits("-3.0").bits(&E4M3), Ok(0xC4)); // 1 1000 100
        assert_eq!(float_bits("0.5").bits(&DOUBLE), Ok(0x3FE0_0000_0000_0000));
        assert_eq!(float_bits("-inf").bits(&FLOAT), Ok(0xFF80_0000));
        // Rounded once: 2^24 + 1 + 2^-40 lies above the middle of two floats, which f64 does not
        // tell.
        assert_eq!(
            float_bits("16777217.0000000000009094947017729282379150390625").bits(&FLOAT),
            Ok(0x4B80_0001)
        );
        assert_eq!((integer(-1).bits(&BYTE), integer(127).bits(&BYTE)), (Ok(0xFF), Ok(0x7F)));
        assert_eq!(
            (LiteralValue::Boolean(true).bits(&Type::Bool), LiteralValue::Boolean(false).bits(&Type::Bool)),
            (Ok(1), Ok(0))
        );
        assert_eq!(LiteralValue::Bytes(vec![1, 2, 3, 4], None).bits(&UINT), Ok(0x0403_0201));
        assert_eq!(LiteralValue::Bytes(vec![0, 0x42], Some(Scalar::F16)).bits(&HALF), Ok(0x4200));
    }

    #[test]
    fn values_of_no_such_type_say_why() {
        for (literal, ty, why) in [
            (float_bits("2.0"), UINT, "2.0 is not an integer"),
            (LiteralValue::Boolean(true), UINT, "true is not a number"),
            (integer(255), BYTE, "255 is out of the range of int8_t, -128 to 127"),
            (integer(-129), BYTE, "-129 is out of the range of int8_t, -128 to 127"),
            (integer(-1), UINT, "-1 is out of the range of uint, 0 to 4294967295"),
            (
                integer(16_777_217),
                FLOAT,
                "16777217 is not exactly representable as float: the nearest value is 16777216",
            ),
            (float_bits("1e-46"), FLOAT, "1e-46 is too small for float: it rounds to 0"),
            (integer(2), Type::Bool, "2 is neither true nor false"),
            (integer(1), Type::Bool, "1 is neither true nor false: write `true`"),
            (LiteralValue::Bytes(vec![0, 0, 128, 63], Some(Scalar::F32)), UINT, "the f32 1.0 is not uint"),
            (float_bits("1e39"), FLOAT, "1e39 is out of the range of float"),
            (LiteralValue::Text("x".into()), UINT, "`x` is not a number"),
            (float_bits("65520.0"), HALF, "65520.0 is out of the range of float16_t"),
            (float_bits("465.0"), E4M3, "465.0 is out of the range of floate4m3_t"),
            (
                LiteralValue::Bytes(vec![0; 8], Some(Scalar::U64)),
                UINT,
                "expected 4 bytes, found 8 (VUID-VkSpecializationMapEntry-constantID-00776)",
            ),
        ] {
            assert_eq!(literal.bits(&ty), Err(why.to_owned()));
        }
    }
}
