//! `[[expect.ray]]` and `[ray.expect]`: what a ray of the scene must find.

use crate::expect::hit::keys;
use crate::expect::numbers;
use crate::expect::payload::literal;
use crate::expect::{
    Difference, Expectations, Fix, HitExpectation, NormalExpectation, Observed, PayloadExpectation, RayFound,
    Subject,
};
use anyhit_base::escape;
use anyhit_engine::accel::Committed;
use anyhit_scene::read::{Parse, Span, Spanned, Table, TomlValue};
use anyhit_unit_test::number::Tolerance;

/// What a ray must find.
#[derive(Clone, Debug)]
pub struct FoundExpectation {
    /// Hit or miss.
    pub hit: HitExpectation,
    /// The payload.
    pub payload: Option<PayloadExpectation>,
    /// The shader's normal.
    pub normal: Option<NormalExpectation>,
    /// How exact t, attributes and the payload's floats are.
    pub tolerance: Tolerance,
    /// Why this is expected.
    pub because: Option<String>,
}

/// `[[expect.ray]]`: of a ray of the scene by its name.
#[derive(Clone, Debug)]
pub struct RayExpectation {
    /// The ray's name.
    pub name: Spanned<String>,
    /// What it must find.
    pub check: FoundExpectation,
}

/// `[ray.expect]`: a test of its own.
#[derive(Clone, Debug)]
pub struct OneRay {
    /// Where the table stands.
    pub span: Span,
    /// What the ray must find.
    pub check: FoundExpectation,
    /// What its shaders must leave behind.
    pub rest: Expectations,
}

impl FoundExpectation {
    fn of(table: &Table<'_>) -> Option<Self> {
        let hit = HitExpectation::of(table);
        let payload = table.value("payload").map(PayloadExpectation::of);
        let normal = NormalExpectation::of(table);
        let tolerance = numbers::tolerance(table);
        let because = table.optional("because");
        Some(Self { hit: hit?, payload, normal: normal?, tolerance: tolerance?, because })
    }

    /// Whether it says nothing of the ray.
    pub fn is_empty(&self) -> bool {
        self.hit.is_empty() && self.payload.is_none() && self.normal.is_none()
    }

    fn check(&self, place: &Span, found: &RayFound) -> Vec<Difference> {
        let because = self.because.as_ref();
        let committed: Option<(Committed, u32)> = found.committed.map(|hit| (hit, found.custom_index));
        let mut differences = self.hit.check(place, committed.as_ref(), self.tolerance, because);
        if let Some(payload) = &self.payload {
            differences.extend(payload.check(&found.payload, self.tolerance, because));
        }
        differences.extend(self.normal.as_ref().and_then(|normal| normal.check(found, because)));
        differences
    }
}

impl Parse for RayExpectation {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let name = table.required("name");
        let check = FoundExpectation::of(&table);
        table.finish();
        let (name, check) = (name?, check?);
        if check.is_empty() {
            return value.wrong("a ray either misses (`miss = true`) or hits (`primitive`, `t`, ...)");
        }
        Some(Self { name, check })
    }
}

impl RayExpectation {
    pub(super) fn check(&self, observed: &Observed, differences: &mut Vec<Difference>) {
        let span = &self.name.span;
        let name = &self.name.value;
        let about = |word| Subject::Ray(name.clone(), word);
        let found = observed.rays.iter().find(|(known, _)| known.as_ref() == Some(name));
        match found {
            None => {
                let known = observed.rays.iter().filter_map(|(name, _)| name.as_deref());
                differences.push(Difference::unknown(&self.name, "ray", known));
            }
            Some((_, Err(trap))) => {
                let trap = trap.clone().context(format!("the ray `{}` trapped", escape::line(name)));
                differences.push(Difference::of(trap).about(about(None)));
            }
            Some((_, Ok(found))) => {
                let all = self.check.check(span, found);
                differences.extend(all.into_iter().map(|one| {
                    let word = match one.subject {
                        Subject::Payload(word) => Some(word),
                        _ => None,
                    };
                    one.about(about(word))
                }));
            }
        }
    }
}

impl Parse for OneRay {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let check = FoundExpectation::of(&table);
        let rest = Expectations::of(&table);
        table.finish();
        Some(Self { span: value.span(), check: check?, rest: rest? })
    }
}

impl OneRay {
    /// Whether it says nothing at all yet.
    pub fn is_empty(&self) -> bool {
        self.check.is_empty() && self.rest.is_empty()
    }

    /// Compares; nothing where everything holds, or where a known failure still fails.
    pub fn differences(&self, observed: &Observed) -> Vec<Difference> {
        let found = self.all_differences(observed);
        match &self.rest.known_failure {
            Some(_) if !found.is_empty() => Vec::new(),
            Some(reason) => {
                let message = "this known failure passes: remove `known_failure`";
                vec![Difference::new(&reason.span, message, Some(&reason.value))]
            }
            None => found,
        }
    }

    fn all_differences(&self, observed: &Observed) -> Vec<Difference> {
        let mut differences = self.rest.all_differences(observed);
        let [(_, Ok(found))] = &observed.rays[..] else { return differences };
        if self.is_empty() {
            differences.push(self.unfilled(found));
        }
        differences.extend(self.check.check(&self.span, found));
        differences
    }

    /// An empty table fails, and is what recording fills.
    fn unfilled(&self, found: &RayFound) -> Difference {
        let mut lines = found.committed.as_ref().map_or_else(|| vec!["miss = true".into()], keys);
        if !found.payload.bytes().is_empty() {
            lines.push(format!("payload = {}", literal(&found.payload)));
        }
        let text = &self.span.source.text[self.span.range.clone()];
        let text = match text.starts_with('{') {
            true => format!("{{ {} }}", lines.join(", ")),
            false => format!("{text}\n{}", lines.join("\n")),
        };
        let message = "this ray has no expectations yet";
        let mut difference = Difference::new(&self.span, message, None);
        difference.fix = Some(Fix::Text(self.span.clone(), text));
        let hint = "record the result with `--bless`, or write `miss = true`, `t = ...`, `payload = { ... }`";
        difference.error = difference.error.note(hint);
        difference
    }
}
