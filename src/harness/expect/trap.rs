//! `[expect.trap]`: how the launch must end.

use crate::error::{Error, Place};
use crate::harness::expect::{Difference, Subject};
use crate::machine::TrapCode;
use crate::scene::read::{Named, Parse, Spanned, Table, TomlValue};

/// The trap that the launch must end with: a name, or a table.
#[derive(Clone, Debug)]
pub struct TrapExpectation {
    /// The trap's code.
    pub code: Spanned<TrapName>,
    /// The launch index that traps.
    pub launch_id: Option<Spanned<[u32; 3]>>,
    /// The line of the shader's source.
    pub line: Option<Spanned<u32>>,
    /// Why this is expected.
    pub because: Option<String>,
}

/// A trap's name in scene files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrapName(pub TrapCode);

impl Named for TrapName {
    const WHAT: &'static str = "trap";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("index_out_of_bounds", Self(TrapCode::IndexOutOfBounds)),
        ("buffer_out_of_bounds", Self(TrapCode::BufferOutOfBounds)),
        ("null_pointer", Self(TrapCode::NullPointer)),
        ("address_invalid", Self(TrapCode::AddressInvalid)),
        ("address_out_of_bounds", Self(TrapCode::AddressOutOfBounds)),
        ("address_misaligned", Self(TrapCode::AddressMisaligned)),
        ("atomic_misaligned", Self(TrapCode::AtomicMisaligned)),
        ("descriptor_missing", Self(TrapCode::DescriptorMissing)),
        ("image_out_of_bounds", Self(TrapCode::ImageOutOfBounds)),
        ("image_mismatch", Self(TrapCode::ImageMismatch)),
        ("sampler_mismatch", Self(TrapCode::SamplerMismatch)),
        ("unreachable", Self(TrapCode::Unreachable)),
        ("out_of_fuel", Self(TrapCode::OutOfFuel)),
        ("launch_out_of_fuel", Self(TrapCode::LaunchOutOfFuel)),
        ("launch_timed_out", Self(TrapCode::LaunchTimedOut)),
        ("batch_timed_out", Self(TrapCode::BatchTimedOut)),
        ("invalid_trace", Self(TrapCode::InvalidTrace)),
        ("acceleration_structure_missing", Self(TrapCode::AccelerationStructureMissing)),
        ("recursion_too_deep", Self(TrapCode::RecursionTooDeep)),
        ("shader_record_missing", Self(TrapCode::ShaderRecordMissing)),
        ("shader_record_empty", Self(TrapCode::ShaderRecordEmpty)),
        ("hit_record_missing", Self(TrapCode::HitRecordMissing)),
        ("miss_record_missing", Self(TrapCode::MissRecordMissing)),
        ("payload_mismatch", Self(TrapCode::PayloadMismatch)),
        ("invalid_hit_kind", Self(TrapCode::InvalidHitKind)),
        ("invalid_ray_query", Self(TrapCode::InvalidRayQuery)),
        ("ray_query_uninitialized", Self(TrapCode::RayQueryUninitialized)),
        ("ray_query_complete", Self(TrapCode::RayQueryComplete)),
        ("ray_query_no_candidate", Self(TrapCode::RayQueryNoCandidate)),
        ("ray_query_no_committed", Self(TrapCode::RayQueryNoCommitted)),
        ("ray_query_not_triangle", Self(TrapCode::RayQueryNotTriangle)),
        ("ray_query_not_aabb", Self(TrapCode::RayQueryNotAabb)),
        ("ray_query_outside_interval", Self(TrapCode::RayQueryOutsideInterval)),
        ("not_triangle", Self(TrapCode::NotTriangle)),
        ("not_sphere", Self(TrapCode::NotSphere)),
        ("not_linear_swept_sphere", Self(TrapCode::NotLinearSweptSphere)),
        ("stack_overflow", Self(TrapCode::StackOverflow)),
        ("callables_too_deep", Self(TrapCode::CallablesTooDeep)),
        ("null_any_hit", Self(TrapCode::NullAnyHit)),
        ("null_closest_hit", Self(TrapCode::NullClosestHit)),
        ("null_miss", Self(TrapCode::NullMiss)),
        ("null_intersection", Self(TrapCode::NullIntersection)),
        ("ray_query_micromaps", Self(TrapCode::RayQueryMicromaps)),
        ("ray_query_motion", Self(TrapCode::RayQueryMotion)),
        ("invalid_hit_object", Self(TrapCode::InvalidHitObject)),
        ("hit_object_no_primitive", Self(TrapCode::HitObjectNoPrimitive)),
        ("hit_object_unrecorded", Self(TrapCode::HitObjectUnrecorded)),
        ("hit_object_empty", Self(TrapCode::HitObjectEmpty)),
        ("hit_object_not_hit", Self(TrapCode::HitObjectNotHit)),
        ("barrier_divergence", Self(TrapCode::BarrierDivergence)),
    ];
    const RENAMED: &'static [(&'static str, &'static str)] = &[("budget_spent", "out_of_fuel")];
}

impl Parse for TrapExpectation {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if value.text().is_some() {
            return Some(Self { code: Spanned::parse(value)?, launch_id: None, line: None, because: None });
        }
        let table = Table::new(value)?;
        let code = table.required("code");
        let launch_id = table.optional("launch_id");
        let line = table.optional("line");
        let because = table.optional("because");
        table.finish();
        Some(Self { code: code?, launch_id, line, because })
    }
}

impl TrapExpectation {
    pub(super) fn check(&self, trap: &Error, found: &mut Vec<Difference>) {
        let because = self.because.as_ref();
        let name = TrapName::NAMES.iter().find(|(_, name)| name.0.message() == trap.message());
        // A record without data was told as a missing one, and that name still holds.
        let empty = self.code.value.0 == TrapCode::ShaderRecordMissing
            && trap.message() == TrapCode::ShaderRecordEmpty.message();
        if !empty && trap.message() != self.code.value.0.message() {
            let message = format!("another trap: {trap}");
            let mut difference = Difference::new(&self.code.span, message, because)
                .about(launch_id(trap).map_or(Subject::Launch, Subject::Invocation));
            if let Some((name, _)) = name {
                difference = difference.mended(&self.code.span, format!("\"{name}\""), because);
            }
            found.push(difference);
            return;
        }
        if let Some(id) = &self.launch_id
            && launch_id(trap) != Some(id.value)
        {
            let mut difference =
                Difference::new(&id.span, format!("another invocation trapped: {trap}"), because);
            if let Some(other) = launch_id(trap) {
                difference = difference
                    .mended(&id.span, format!("{other:?}"), because)
                    .about(Subject::Invocation(other));
            }
            found.push(difference);
        }
        if let Some(line) = &self.line
            && line_of(trap) != Some(line.value)
        {
            let mut difference = Difference::new(&line.span, format!("trapped elsewhere: {trap}"), because);
            if let Some(other) = line_of(trap) {
                difference = difference.mended(&line.span, other.to_string(), because);
            }
            found.push(difference);
        }
    }
}

/// The launch index that a trap's report names.
pub(super) fn launch_id(trap: &Error) -> Option<[u32; 3]> {
    let note = trap.notes().iter().find_map(|note| note.rsplit_once(" id ("))?.1;
    let numbers = note.trim_end_matches(')').split(", ").map(|number| number.parse().ok());
    numbers.collect::<Option<Vec<u32>>>()?.try_into().ok()
}

/// The source line that an error points at, where it knows one.
fn line_of(error: &Error) -> Option<u32> {
    error.places().find_map(|(place, _)| match place {
        Place::Line { line, .. } => Some(*line),
        Place::Text { text, span, .. } => Some(text[..span.start].matches('\n').count() as u32 + 1),
        _ => None,
    })
}
