//! `normal = "exact"` of a ray: its shader's normal against the exact one of what was hit.

use crate::expect::{Difference, RayFound, Subject};
use anyhit_engine::accel::surface_normal;
use anyhit_scene::read::{Named, Span, Spanned, Table};
use anyhit_unit_test::normal::{difference, vector_at};

/// The angle, in degrees, by which a normal may be off unless `normal_degrees` says otherwise: more
/// than the roundings of a shader in f32, and less than any wrong formula.
const DEGREES: f64 = 0.01;

/// What the normal must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    Exact,
}

impl Named for Wanted {
    const WHAT: &'static str = "normal";
    const NAMES: &'static [(&'static str, Self)] = &[("exact", Self::Exact)];
}

/// The space of a shader's normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Space {
    World,
    Object,
}

impl Named for Space {
    const WHAT: &'static str = "space";
    const NAMES: &'static [(&'static str, Self)] = &[("world", Self::World), ("object", Self::Object)];
}

/// A comparison of a member of the payload with the exact normal.
#[derive(Clone, Debug)]
pub struct NormalExpectation {
    span: Span,
    member: Option<Spanned<String>>,
    degrees: f64,
    space: Space,
}

impl NormalExpectation {
    /// Reads the keys; `Some(None)` where there are none, `None` where they are wrong.
    pub(super) fn of(table: &Table<'_>) -> Option<Option<Self>> {
        let wanted: Option<Spanned<Wanted>> = table.optional("normal");
        let member: Option<Spanned<String>> = table.optional("normal_member");
        let degrees: Option<Spanned<f64>> = table.optional("normal_degrees");
        let space: Option<Spanned<Space>> = table.optional("normal_space");
        if let Some(degrees) = degrees.as_ref().filter(|degrees| !(0.0..=180.0).contains(&degrees.value)) {
            table.report().push(degrees.span.error("an angle must be from 0 to 180 degrees"));
            return None;
        }
        let Some(wanted) = wanted else {
            let spans = [
                member.as_ref().map(|one| &one.span),
                degrees.as_ref().map(|one| &one.span),
                space.as_ref().map(|one| &one.span),
            ];
            let alone = spans.into_iter().flatten().next();
            if let Some(span) = alone.filter(|_| !table.has_name("normal")) {
                table.report().push(span.error("this requires `normal = \"exact\"`"));
                return None;
            }
            return Some(None);
        };
        Some(Some(Self {
            span: wanted.span,
            member,
            degrees: degrees.map_or(DEGREES, |degrees| degrees.value),
            space: space.map_or(Space::World, |space| space.value),
        }))
    }

    pub(super) fn check(&self, found: &RayFound, because: Option<&String>) -> Option<Difference> {
        let difference_at = |span: &Span, message: String| Some(Difference::new(span, message, because));
        let (Some(committed), Some((tlas, trace))) = (&found.committed, &found.traced) else {
            return difference_at(&self.span, "expected a normal, but the ray misses".to_owned());
        };
        let hit = committed.candidate.hit_primitive();
        let Some(exact) = surface_normal(tlas, trace, hit) else {
            let why = if committed.candidate.is_box() {
                "the surface in an AABB is defined by its intersection shader"
            } else {
                "the hit has none"
            };
            return difference_at(&self.span, format!("no exact normal is known: {why}"));
        };
        let member = self.member.as_ref().map(|member| member.value.as_str());
        let (vector, word) = match vector_at(&found.payload, member) {
            Ok(found) => found,
            Err(message) => {
                let span = self.member.as_ref().map_or(&self.span, |member| &member.span);
                return difference_at(span, message);
            }
        };
        let (exact, space) = match self.space {
            Space::World => (exact.world, "in world space"),
            Space::Object => (exact.object, "in object space"),
        };
        let message = difference(vector, exact, self.degrees)?;
        let difference = Difference::new(&self.span, format!("normal {space}: {message}"), because);
        Some(difference.about(Subject::Payload(word)))
    }
}
