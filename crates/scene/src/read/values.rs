//! What values are read as: names, numbers, texts, arrays of them.

use serde_json::json;

use crate::read::recorder::{JsonSchema, SchemaProbe};
use crate::read::{Named, Parse, Spanned, TomlValue, schema};
use crate::tree::Toml;
use anyhit_base::error::names::nearest;
use anyhit_base::escape;

impl<T: Named> Parse for T {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let at = name_in(value, T::WHAT, &names_of::<T>())?;
        Some(T::NAMES[at].1)
    }

    fn schema(_: &mut SchemaProbe) -> JsonSchema {
        schema::one_of(&names_of::<T>())
    }
}

/// The names of a closed set.
pub(super) fn names_of<T: Named>() -> Vec<&'static str> {
    let mut names = Vec::new();
    for (name, _) in T::NAMES {
        names.push(*name);
    }
    names
}

/// Reads a name; returns its place among those that are known.
fn name_in(value: TomlValue<'_>, what: &str, names: &[&'static str]) -> Option<usize> {
    if let Some(recorder) = value.report.recorder() {
        recorder.names(value.node.range(), names);
    }
    let Some(name) = value.text() else { return value.expected(&format!("a string ({what})")) };
    if let Some(at) = names.iter().position(|known| *known == name) {
        return Some(at);
    }
    let label = match nearest(name, names.iter().copied()) {
        Some(suggestion) => format!("did you mean `{suggestion}`?"),
        None => "no such name".to_string(),
    };
    value.report.push(
        value
            .span()
            .error_with(format!("unknown {what} `{name}`"), label)
            .note(format!("one of: {}", names.join(", "))),
    );
    None
}

impl Parse for bool {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        match value.toml() {
            Toml::Boolean(flag) => Some(*flag),
            _ => value.expected("true or false"),
        }
    }

    fn schema(_: &mut SchemaProbe) -> JsonSchema {
        json!({ "type": "boolean" })
    }
}

/// A name, a path or a reason: control characters of it, line feeds among them, are escapes from
/// here on. [`RawText`] keeps them.
impl Parse for String {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        value.text().map(|text| escape::controls(text).into_owned()).or_else(|| value.expected("a string"))
    }

    fn schema(_: &mut SchemaProbe) -> JsonSchema {
        json!({ "type": "string" })
    }
}

/// A text of several lines that is compared with what shaders print.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawText(pub String);

impl Parse for RawText {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        value.text().map(|text| Self(text.to_owned())).or_else(|| value.expected("a string"))
    }

    fn schema(_: &mut SchemaProbe) -> JsonSchema {
        json!({ "type": "string" })
    }
}

/// An integer, checked against a range.
pub(crate) fn integer(value: TomlValue<'_>, least: i128, most: i128, what: &str) -> Option<i128> {
    let Toml::Integer(digits, radix) = value.toml() else {
        return value.expected(&format!("an integer ({what})"));
    };
    match i128::from_str_radix(digits, *radix) {
        Ok(number) if (least..=most).contains(&number) => Some(number),
        _ => value.wrong(format!("out of range: {what} ranges from {least} to {most}")),
    }
}

macro_rules! integers {
    ($($ty:ident)*) => {$(
        impl Parse for $ty {
            fn parse(value: TomlValue<'_>) -> Option<Self> {
                let number = integer(value, $ty::MIN as i128, $ty::MAX as i128, stringify!($ty))?;
                Some(number as $ty)
            }

            fn schema(_: &mut SchemaProbe) -> JsonSchema {
                json!({ "type": "integer", "minimum": $ty::MIN, "maximum": $ty::MAX })
            }
        }
    )*};
}
integers!(u8 u16 u32 u64 i8 i16 i32 i64);

macro_rules! floats {
    ($($ty:ident)*) => {$(
        /// Rounds once, from the decimal text: through f64 some numbers would be rounded twice.
        impl Parse for $ty {
            fn parse(value: TomlValue<'_>) -> Option<Self> {
                let (text, named_infinity) = match value.toml() {
                    Toml::Float(text) => (text, text.contains("inf")),
                    Toml::Integer(digits, 10) => (digits, false),
                    _ => return value.expected("a number"),
                };
                match text.parse::<$ty>() {
                    Ok(number) if number.is_infinite() && !named_infinity => {
                        value.wrong(format!("`{text}` is out of the range of {}", stringify!($ty)))
                    }
                    Ok(number) => match value.toml() {
                        Toml::Integer(digits, _) if digits.parse() != Ok(number as i128) => value.wrong(
                            format!("`{text}` is not exactly representable as {}: the nearest value is {number}", stringify!($ty)),
                        ),
                        _ => Some(number),
                    },
                    Err(_) => value.expected("a number"),
                }
            }

            fn schema(_: &mut SchemaProbe) -> JsonSchema {
                json!({ "type": "number" })
            }
        }
    )*};
}
floats!(f32 f64);

impl<T: Parse> Parse for Spanned<T> {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        T::parse(value).map(|parsed| Spanned { value: parsed, span: value.span() })
    }

    fn schema(probe: &mut SchemaProbe) -> JsonSchema {
        T::schema(probe)
    }
}

/// Reports the mistakes of all elements before giving up.
impl<T: Parse> Parse for Vec<T> {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let Some(elements) = value.elements() else { return value.expected("an array") };
        let (mut parsed, mut is_whole) = (Vec::with_capacity(elements.size_hint().0), true);
        for element in elements {
            match T::parse(element) {
                Some(one) => parsed.push(one),
                None => is_whole = false,
            }
        }
        is_whole.then_some(parsed)
    }

    fn schema(probe: &mut SchemaProbe) -> JsonSchema {
        json!({ "type": "array", "items": T::schema(probe) })
    }
}

impl<T: Parse, const N: usize> Parse for [T; N] {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let parsed: Vec<T> = Parse::parse(value)?;
        let found = parsed.len();
        match parsed.try_into() {
            Ok(array) => Some(array),
            Err(_) => value.wrong(format!("expected {N} elements, found {found}")),
        }
    }

    fn schema(probe: &mut SchemaProbe) -> JsonSchema {
        json!({ "type": "array", "items": T::schema(probe), "minItems": N, "maxItems": N })
    }
}

/// One value or an array of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OneOrMore<T>(pub Vec<T>);

impl<T: Parse> Parse for OneOrMore<T> {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if matches!(value.toml(), Toml::Array(_)) {
            Vec::parse(value).map(Self)
        } else {
            T::parse(value).map(|one| Self(vec![one]))
        }
    }

    fn schema(probe: &mut SchemaProbe) -> JsonSchema {
        let one = T::schema(probe);
        json!({ "anyOf": [one, { "type": "array", "items": one }] })
    }
}
