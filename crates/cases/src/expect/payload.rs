//! `payload` of a ray: values by the names of the payload's members.

use crate::expect::{Difference, Subject, numbers};
use anyhit_base::error::names::nearest;
use anyhit_scene::read::{Diagnostics, OwnedTomlValue, Span, Table, TomlValue};
use anyhit_scene::tree::Toml;
use anyhit_unit_test::number::{NumberType, Tolerance};
use anyhit_unit_test::value::Value as Found;

/// A payload as it is expected: a table of some members, nested as the payload is. A payload of one
/// member needs no table.
#[derive(Clone, Debug)]
pub struct PayloadExpectation(OwnedTomlValue);

/// The comparison on its way down the payload.
struct Comparison<'a> {
    tolerance: Tolerance,
    because: Option<&'a String>,
    differences: Vec<Difference>,
}

impl PayloadExpectation {
    pub(super) fn of(value: TomlValue<'_>) -> Self {
        Self(value.to_owned_value())
    }

    /// Where it stands.
    pub fn span(&self) -> Span {
        self.0.span()
    }

    pub(super) fn check(
        &self,
        found: &Found,
        tolerance: Tolerance,
        because: Option<&String>,
    ) -> Vec<Difference> {
        let report = Diagnostics::default();
        let mut comparison = Comparison { tolerance, because, differences: Vec::new() };
        comparison.compare(self.0.value(&report), found, "payload", 0);
        let mistakes = report.finish().err();
        let mistakes = mistakes.map(Difference::of);
        mistakes.into_iter().chain(comparison.differences).collect()
    }
}

impl Comparison<'_> {
    /// Compares a part that begins at a word of the payload.
    fn compare(&mut self, expected: TomlValue<'_>, found: &Found, path: &str, word: usize) {
        if expected.text() == Some("any") {
            return;
        }
        match (expected.toml(), scalar_of(found)) {
            (_, Some((scalar, bits))) => self.scalar(expected, scalar, bits, found, path, word),
            (Toml::Table(_), None) if found.fields().next().is_some() => {
                self.members(expected, found, path, word);
            }
            (_, None) if found.fields().count() == 1 => {
                let only = found.fields().next().map(|(_, only)| only);
                self.compare(expected, only.unwrap_or(found), path, word);
            }
            (Toml::Array(elements), None) if found.fields().next().is_none() => {
                if elements.len() != found.elements().len() {
                    let message = format!(
                        "{path}: {} has {} elements, found {}",
                        found.ty(),
                        found.elements().len(),
                        elements.len()
                    );
                    expected.wrong::<()>(message);
                    return;
                }
                let mut word = word;
                for (at, (one, found)) in
                    expected.elements().into_iter().flatten().zip(found.elements()).enumerate()
                {
                    self.compare(one, found, &format!("{path}[{at}]"), word);
                    word += words(found);
                }
            }
            _ => {
                expected.wrong::<()>(format!(
                    "{path}: this is {}, not {}",
                    found.ty(),
                    expected.toml().what()
                ));
            }
        }
    }

    fn members(&mut self, expected: TomlValue<'_>, found: &Found, path: &str, word: usize) {
        let Some(table) = Table::new(expected) else { return };
        for (name, value) in table.iter() {
            let mut word = word;
            let member = found.fields().find_map(|(known, member)| {
                let at = word;
                word += words(member);
                (known == name.value).then_some((member, at))
            });
            match member {
                Some((member, at)) => self.compare(value, member, &format!("{path}.{}", name.value), at),
                None => {
                    let names = || found.fields().map(|(name, _)| name);
                    let label = nearest(&name.value, names()).map(|near| format!("did you mean `{near}`?"));
                    let message = format!("{path}: {} has no member `{}`", found.ty(), name.value);
                    let all: Vec<_> = names().collect();
                    let error = name.span.error_with(message, label.unwrap_or_default());
                    expected.report().push(error.note(format!("its members are: {}", all.join(", "))));
                }
            }
        }
    }

    fn scalar(
        &mut self,
        expected: TomlValue<'_>,
        scalar: Option<NumberType>,
        bits: u64,
        found: &Found,
        path: &str,
        word: usize,
    ) {
        let span = expected.span();
        let (message, text) = match (scalar, expected.toml()) {
            (None, Toml::Boolean(wanted)) => {
                if *wanted == (bits != 0) {
                    return;
                }
                (format!("expected {wanted}, found {}", bits != 0), (bits != 0).to_string())
            }
            (None, _) => {
                expected.expected::<()>(&format!("true or false, as {path} is a bool"));
                return;
            }
            (Some(_), Toml::Array(_) | Toml::Table(_) | Toml::Boolean(_) | Toml::String(_)) => {
                expected.expected::<()>(&format!("a number, as {path} is {}", found.ty()));
                return;
            }
            (Some(scalar), _) => {
                let Some(wanted) = numbers::expected_number(expected, scalar) else { return };
                let Some(message) = self.tolerance.difference(scalar, &wanted.value, bits) else { return };
                (message, scalar.literal(bits))
            }
        };
        let difference = Difference::new(&span, format!("{path}: {message}"), self.because);
        let difference = difference.mended(&span, text, self.because);
        self.differences.push(difference.about(Subject::Payload(word)));
    }
}

/// How many words a part of a payload takes: its scalars follow each other, see
/// [`layout`](anyhit_unit_test::layout).
fn words(found: &Found) -> usize {
    found.bytes().len() / 4
}

/// A scalar's type and bits; no type for a bool.
pub(crate) fn scalar_of(found: &Found) -> Option<(Option<NumberType>, u64)> {
    let scalar = match found.ty() {
        "bool" => return Some((None, u64::from(found.bool()))),
        "float" => NumberType::F32,
        "double" => NumberType::F64,
        "float16_t" => NumberType::F16,
        "bfloat16_t" => NumberType::Bf16,
        "floate4m3_t" => NumberType::E4m3,
        "floate5m2_t" => NumberType::E5m2,
        "int" => NumberType::I32,
        "uint" => NumberType::U32,
        "int8_t" => NumberType::I8,
        "int16_t" => NumberType::I16,
        "int64_t" => NumberType::I64,
        "uint8_t" => NumberType::U8,
        "uint16_t" => NumberType::U16,
        "uint64_t" => NumberType::U64,
        _ => return None,
    };
    let bits = scalar.load(found.bytes(), 0)?;
    Some((Some(scalar), bits))
}

/// A payload as a scene file writes it: what an expectation of all of it says.
pub(crate) fn literal(found: &Found) -> String {
    if let Some((scalar, bits)) = scalar_of(found) {
        return scalar.map_or_else(|| (bits != 0).to_string(), |scalar| scalar.literal(bits));
    }
    let fields: Vec<_> =
        found.fields().map(|(name, value)| format!("{} = {}", key(name), literal(value))).collect();
    match fields.is_empty() {
        true => format!("[{}]", found.elements().iter().map(literal).collect::<Vec<_>>().join(", ")),
        false => format!("{{ {} }}", fields.join(", ")),
    }
}

/// A name as a TOML key.
pub(crate) fn key(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if bare { name.into() } else { format!("{name:?}") }
}
