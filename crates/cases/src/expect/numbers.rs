//! Numbers of an expectation as a scene file writes them, with their types and tolerances.

use anyhit_engine::math::float_format::FloatFormat;
use anyhit_engine::module::decimal::{FloatMisfit, decimal_bits, decimal_value};
use anyhit_scene::read::{Parse, Spanned, Table, TomlValue};
use anyhit_scene::scalar::float_bits;
use anyhit_scene::tree::Toml;
use anyhit_unit_test::number::{ExpectedNumber, NumberType, Tolerance};

const SCALARS: [(&str, NumberType); 14] = [
    ("f16", NumberType::F16),
    ("f32", NumberType::F32),
    ("f64", NumberType::F64),
    ("bf16", NumberType::Bf16),
    ("e4m3", NumberType::E4m3),
    ("e5m2", NumberType::E5m2),
    ("u8", NumberType::U8),
    ("u16", NumberType::U16),
    ("u32", NumberType::U32),
    ("u64", NumberType::U64),
    ("i8", NumberType::I8),
    ("i16", NumberType::I16),
    ("i32", NumberType::I32),
    ("i64", NumberType::I64),
];

/// The bits of a number of a type, and its value.
fn number(value: TomlValue<'_>, scalar: NumberType) -> Option<(u64, f64)> {
    if let Some(format) = scalar.format() {
        return float(value, scalar, format);
    }
    let bits = match scalar {
        NumberType::U8 => u8::parse(value).map(u64::from),
        NumberType::U16 => u16::parse(value).map(u64::from),
        NumberType::U32 => u32::parse(value).map(u64::from),
        NumberType::U64 => u64::parse(value),
        NumberType::I8 => i8::parse(value).map(|number| u64::from(number as u8)),
        NumberType::I16 => i16::parse(value).map(|number| u64::from(number as u16)),
        NumberType::I32 => i32::parse(value).map(|number| u64::from(number as u32)),
        _ => i64::parse(value).map(|number| number as u64),
    }?;
    Some((bits, scalar.value(bits)))
}

/// The bits, and the value that is not rounded: it counts where a tolerance is given, with which 0
/// may be near enough to what rounds to it.
fn float(value: TomlValue<'_>, scalar: NumberType, format: FloatFormat) -> Option<(u64, f64)> {
    if let Toml::Float(text) = value.toml()
        && decimal_bits(text, format) == Err(FloatMisfit::Vanishes)
    {
        let exact = decimal_value(text)?;
        return Some((format.round(0.0_f64.copysign(exact)), exact));
    }
    let name = SCALARS.iter().find(|(_, known)| *known == scalar).map_or("", |found| found.0);
    let bits = float_bits(value, format, name)?;
    let (Toml::Float(text) | Toml::Integer(text, _)) = value.toml() else { return None };
    Some((bits, decimal_value(text)?))
}

/// Reads a number of a type, or `"any"`.
pub fn expected_number(value: TomlValue<'_>, scalar: NumberType) -> Option<Spanned<ExpectedNumber>> {
    let expected = match value.is_word("any") {
        true => ExpectedNumber::Any,
        false => number(value, scalar).map(|(bits, exact)| ExpectedNumber::Number(bits, exact))?,
    };
    Some(Spanned { value: expected, span: value.span() })
}

/// Typed numbers, by the elements of the outermost array.
#[derive(Clone, Debug, PartialEq)]
pub struct TypedNumbers {
    /// The scalar type of the numbers.
    pub scalar: NumberType,
    /// Inner arrays are flattened.
    pub elements: Vec<Vec<Spanned<ExpectedNumber>>>,
}

impl TypedNumbers {
    /// Reads the one key of a table that is named as a type: `f32 = [[0, 1], [2, "any"]]`.
    pub fn of(table: &Table<'_>) -> Option<Self> {
        let given: Vec<_> =
            SCALARS.iter().filter_map(|(key, scalar)| Some((scalar, table.value(key)?))).collect();
        let [(scalar, value)] = given[..] else {
            table.report().push(table.span().error("expected numbers of one type: `f32 = [...]`"));
            return None;
        };
        let elements = match value.elements() {
            Some(elements) => elements.map(|element| flatten(element, *scalar)).collect::<Option<_>>()?,
            None => vec![flatten(value, *scalar)?],
        };
        Some(Self { scalar: *scalar, elements })
    }
}

fn flatten(value: TomlValue<'_>, scalar: NumberType) -> Option<Vec<Spanned<ExpectedNumber>>> {
    match value.elements() {
        Some(elements) => {
            let parts: Option<Vec<_>> = elements.map(|element| flatten(element, scalar)).collect();
            Some(parts?.concat())
        }
        None => Some(vec![expected_number(value, scalar)?]),
    }
}

/// Reads `ulp`, `absolute` or `relative`; exact without.
pub fn tolerance(table: &Table<'_>) -> Option<Tolerance> {
    let given: Vec<(Spanned<f64>, &str)> = ["ulp", "absolute", "relative"]
        .into_iter()
        .filter_map(|key| Some((table.optional(key)?, key)))
        .collect();
    match &given[..] {
        [] => Some(Tolerance::Exact),
        [(bound, key)] if bound.value >= 0.0 => Some(match *key {
            "ulp" => Tolerance::Ulp(bound.value),
            "absolute" => Tolerance::Absolute(bound.value),
            _ => Tolerance::Relative(bound.value),
        }),
        [(bound, _), ..] => {
            let message = "one of `ulp`, `absolute` and `relative`, not below zero";
            table.report().push(bound.span.error(message));
            None
        }
    }
}
