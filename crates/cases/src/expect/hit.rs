//! The hit record of a ray: what `[[expect.ray]]` and `[ray.expect]` say of it.

use std::sync::Arc;

use crate::expect::Difference;
use crate::expect::numbers;
use anyhit_engine::accel::{Committed, Tlas, TraceRay};
use anyhit_scene::read::{Span, Spanned, Table};
use anyhit_unit_test::number::{ExpectedNumber, NumberType, Tolerance};
use anyhit_unit_test::value::Value as Found;

/// What a ray found.
#[derive(Clone, Debug)]
pub struct RayFound {
    /// The closest hit; `None` for a miss.
    pub committed: Option<Committed>,
    /// `InstanceCustomIndexKHR` of the hit.
    pub custom_index: u32,
    /// The structure and the ray, where one was traced.
    pub traced: Option<(Arc<Tlas>, TraceRay)>,
    /// The payload that it brought back, by the names of its members.
    pub payload: Found,
}

/// A hit in the parts that count, or a miss.
#[derive(Clone, Debug)]
pub struct HitExpectation {
    /// `miss = true`, from its key to its value.
    pub miss: Option<Span>,
    /// `InstanceId`, `RayGeometryIndexKHR`, `PrimitiveId`, `HitKindKHR`, `InstanceCustomIndexKHR`.
    pub numbers: [Option<Spanned<u32>>; 5],
    /// The hit distance.
    pub t: Option<Spanned<ExpectedNumber>>,
    /// The hit attributes of a triangle or a linear swept sphere.
    pub attributes: Vec<Spanned<ExpectedNumber>>,
}

/// The keys of [`HitExpectation::numbers`], in its order.
const NUMBERS: [&str; 5] = ["instance", "geometry", "primitive", "kind", "custom_index"];

impl HitExpectation {
    pub(super) fn of(table: &Table<'_>) -> Option<Self> {
        let miss = table.or("miss", false).then(|| key_and_value(table, "miss")).flatten();
        let numbers = NUMBERS.map(|key| table.optional(key));
        let float = |value| numbers::expected_number(value, NumberType::F32);
        let t = table.value("t").and_then(float);
        let attributes = table.value("attributes");
        let attributes: Vec<_> =
            attributes.and_then(|value| value.elements()).into_iter().flatten().filter_map(float).collect();
        let hit = Self { miss, numbers, t, attributes };
        if let Some(span) = hit.miss.as_ref().filter(|_| hit.is_hit()) {
            let message = "a ray either misses (`miss = true`) or hits (`primitive`, `t`, ...)";
            table.report().push(span.error(message));
            return None;
        }
        Some(hit)
    }

    fn is_hit(&self) -> bool {
        self.numbers.iter().any(Option::is_some) || self.t.is_some() || !self.attributes.is_empty()
    }

    /// Whether it says neither hit nor miss.
    pub fn is_empty(&self) -> bool {
        self.miss.is_none() && !self.is_hit()
    }

    pub(super) fn check(
        &self,
        place: &Span,
        found: Option<&(Committed, u32)>,
        tolerance: Tolerance,
        because: Option<&String>,
    ) -> Vec<Difference> {
        let (hit, custom_index) = match (&self.miss, found) {
            (None, _) if !self.is_hit() => return Vec::new(),
            (Some(_), None) => return Vec::new(),
            (Some(span), Some((hit, custom_index))) => {
                let message = format!("expected a miss, but the ray hits {}", words(hit, *custom_index));
                // In an inline table keys follow each other in one line.
                let before = &span.source.text[..span.range.start];
                let is_inline = before.rsplit('\n').next().is_some_and(|line| line.contains('{'));
                let text = keys(hit).join(if is_inline { ", " } else { "\n" });
                return vec![Difference::new(span, message, because).mended(span, text, because)];
            }
            (None, None) => {
                let span = self.first_span().unwrap_or(place);
                return vec![Difference::new(span, "expected a hit, but the ray misses", because)];
            }
            (None, Some((hit, custom_index))) => (hit, *custom_index),
        };
        let mut differences = Vec::new();
        let candidate = &hit.candidate;
        let numbers =
            [candidate.instance, candidate.geometry, candidate.primitive, hit.hit_kind.0, custom_index];
        for ((expected, found), name) in self.numbers.iter().zip(numbers).zip(NUMBERS) {
            let Some(Spanned { value, span }) = expected else { continue };
            if *value != found {
                let is_hexadecimal = span.source.text[span.range.clone()].starts_with("0x");
                let text = |number: u32| match is_hexadecimal {
                    true => format!("{number:#x}"),
                    false => number.to_string(),
                };
                let message = format!("{name}: expected {}, found {}", text(*value), text(found));
                differences.push(Difference::new(span, message, because).mended(span, text(found), because));
            }
        }
        let attributes = self.attributes.iter().zip(candidate.intersection.attributes).enumerate();
        let attributes =
            attributes.map(|(at, (expected, found))| (format!("attribute {at}"), expected, found));
        let t = self.t.iter().map(|expected| ("t".to_string(), expected, hit.t));
        for (name, expected, found) in t.chain(attributes) {
            let bits = u64::from(found.to_bits());
            if let Some(message) = tolerance.difference(NumberType::F32, &expected.value, bits) {
                let span = &expected.span;
                let difference = Difference::new(span, format!("{name}: {message}"), because);
                differences.push(difference.mended(span, NumberType::F32.literal(bits), because));
            }
        }
        differences
    }

    fn first_span(&self) -> Option<&Span> {
        let numbers = self.numbers.iter().flatten().map(|number| &number.span);
        numbers.chain(self.t.iter().chain(&self.attributes).map(|number| &number.span)).next()
    }
}

/// From a key to its value.
fn key_and_value(table: &Table<'_>, key: &'static str) -> Option<Span> {
    let value = table.value(key)?.span();
    let (key, _) = table.iter().find(|(name, _)| name.value == key)?;
    Some(Span { source: value.source, range: key.span.range.start..value.range.end })
}

/// A hit in a few words.
fn words(hit: &Committed, custom_index: u32) -> String {
    let custom = if custom_index == 0 { String::new() } else { format!(" (custom index {custom_index})") };
    format!(
        "instance {}{custom}, geometry {}, primitive {} at t = {:?}",
        hit.candidate.instance, hit.candidate.geometry, hit.candidate.primitive, hit.t
    )
}

/// A hit as lines of a scene file.
pub(crate) fn keys(hit: &Committed) -> Vec<String> {
    vec![
        format!("instance = {}", hit.candidate.instance),
        format!("geometry = {}", hit.candidate.geometry),
        format!("primitive = {}", hit.candidate.primitive),
        format!("t = {}", NumberType::F32.literal(u64::from(hit.t.to_bits()))),
    ]
}
