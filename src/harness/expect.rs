//! `[expect]`: what a scene's launch must leave behind, and the comparison.
//!
//! Expected values are derived, never recorded: each table names its reason (`because`: a section
//! of a specification, a VUID, arithmetic). Every number knows its place in the file, so that a
//! difference is shown with line and caret.

use crate::accel::Committed;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::harness::number::{Expected, Numbers, Scalar, Tolerance};
use crate::machine::TrapCode;
use crate::module::interface::Stage;
use crate::pipeline::Stats;
use crate::scene::read::{At, Document, Named, Parse, Report, Span, Table, Value};

/// How many differences of one table are shown.
const SHOWN: usize = 6;

/// All that `[expect]` says.
#[derive(Clone, Debug)]
pub struct Expectations {
    /// Why the case is known to fail; it must fail then.
    pub known_failure: Option<At<String>>,
    /// `[expect.trap]`
    pub trap: Option<TrapExpectation>,
    /// `[[expect.buffer]]`
    pub buffers: Vec<BytesExpectation>,
    /// `[[expect.image]]`
    pub images: Vec<BytesExpectation>,
    /// `[[expect.ray]]`
    pub rays: Vec<RayExpectation>,
    /// `[expect.stats]`
    pub stats: Option<StatsExpectation>,
}

/// What a launch left behind.
#[derive(Clone, Debug, Default)]
pub struct Observed {
    /// The trap of the lowest launch index.
    pub trap: Option<Error>,
    /// The content of every buffer.
    pub buffers: Vec<Bytes>,
    /// The texels of every image, row by row.
    pub images: Vec<Bytes>,
    /// What became of each `[[ray]]`: its name and the committed hit, or its trap.
    pub rays: Vec<(Option<String>, Result<Option<Committed>>)>,
    /// What was done; `None` where the launch trapped.
    pub stats: Option<Stats>,
}

/// A resource's memory after the launch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bytes {
    /// The name in the scene.
    pub name: String,
    /// Set, binding, array element.
    pub binding: [u32; 3],
    /// An image's width, and the bytes of a texel.
    pub row: Option<[usize; 2]>,
    /// The content.
    pub bytes: Vec<u8>,
}

impl Expectations {
    /// Reads `[expect]`; a scene without it expects nothing but to run without a trap.
    ///
    /// # Errors
    /// All mistakes of the table as one error.
    pub fn read(document: &Document) -> Result<Self> {
        let report = Report::default();
        let root = document.root(&report);
        let read = match root.value("expect") {
            Some(value) => Self::parse(value),
            None => Some(Self {
                known_failure: None,
                trap: None,
                buffers: Vec::new(),
                images: Vec::new(),
                rays: Vec::new(),
                stats: None,
            }),
        };
        drop(root);
        report.finish()?;
        Ok(read.expect("bug in anyhit: expectations failed without a mistake"))
    }

    /// Whether nothing is expected beside a launch without a trap.
    pub fn is_empty(&self) -> bool {
        self.trap.is_none()
            && self.stats.is_none()
            && self.buffers.is_empty()
            && self.images.is_empty()
            && self.rays.is_empty()
    }

    /// Compares; no error where everything holds, or where a known failure still fails.
    ///
    /// # Errors
    /// `Expectation` with every difference at its place in the scene file.
    pub fn check(&self, observed: &Observed) -> Result<()> {
        let mut errors = Vec::new();
        self.check_trap(observed, &mut errors);
        for (list, memory) in [(&self.buffers, &observed.buffers), (&self.images, &observed.images)] {
            for expectation in list {
                expectation.check(memory, &mut errors);
            }
        }
        for ray in &self.rays {
            ray.check(observed, &mut errors);
        }
        if let (Some(expected), Some(stats)) = (&self.stats, &observed.stats) {
            expected.check(stats, &mut errors);
        }
        match (&self.known_failure, errors.is_empty()) {
            (None, true) | (Some(_), false) => Ok(()),
            (None, false) => Err(Error::several(errors)),
            (Some(reason), true) => {
                Err(differs(&reason.span, "this known failure passes: take it out", &reason.value))
            }
        }
    }

    fn check_trap(&self, observed: &Observed, errors: &mut Vec<Error>) {
        match (&self.trap, &observed.trap) {
            (None, None) => {}
            (None, Some(trap)) => errors.push(trap.clone().context("the launch trapped")),
            (Some(expected), None) => {
                let message = format!("no trap; expected: {}", expected.code.value.0.message());
                errors.push(differs(&expected.code.span, message, &expected.because));
            }
            (Some(expected), Some(trap)) => expected.check(trap, errors),
        }
    }
}

impl Parse for Expectations {
    fn parse(value: Value<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let known_failure = table.optional("known_failure");
        let trap = table.optional("trap");
        let lists = ["buffer", "image"].map(|key| table.or(key, Vec::new()));
        let rays = table.or("ray", Vec::new());
        let stats = table.optional("stats");
        table.finish();
        let [buffers, images] = lists;
        Some(Self { known_failure, trap, buffers, images, rays, stats })
    }
}

/// An error about a difference from what was expected.
fn differs(span: &Span, message: impl Into<String>, because: &str) -> Error {
    let error = Error::new(ErrorKind::Expectation, message).at_with(span.place(), "");
    error.note(format!("because: {because}"))
}

/// The trap that the launch must end with.
#[derive(Clone, Debug)]
pub struct TrapExpectation {
    /// Which.
    pub code: At<TrapName>,
    /// The launch index that traps.
    pub launch_id: Option<At<[u32; 3]>>,
    /// The line of the shader's source.
    pub line: Option<At<u32>>,
    /// Why.
    pub because: String,
}

/// A trap's name in scene files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrapName(pub TrapCode);

impl Named for TrapName {
    const WHAT: &'static str = "trap";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("index_out_of_bounds", Self(TrapCode::IndexOutOfBounds)),
        ("buffer_out_of_bounds", Self(TrapCode::BufferOutOfBounds)),
        ("descriptor_missing", Self(TrapCode::DescriptorMissing)),
        ("image_out_of_bounds", Self(TrapCode::ImageOutOfBounds)),
        ("image_mismatch", Self(TrapCode::ImageMismatch)),
        ("sampler_mismatch", Self(TrapCode::SamplerMismatch)),
        ("unreachable", Self(TrapCode::Unreachable)),
        ("budget_spent", Self(TrapCode::BudgetSpent)),
        ("invalid_trace", Self(TrapCode::InvalidTrace)),
        ("acceleration_structure_missing", Self(TrapCode::AccelerationStructureMissing)),
        ("recursion_too_deep", Self(TrapCode::RecursionTooDeep)),
        ("shader_record_missing", Self(TrapCode::ShaderRecordMissing)),
        ("invalid_hit_kind", Self(TrapCode::InvalidHitKind)),
        ("invalid_ray_query", Self(TrapCode::InvalidRayQuery)),
        ("ray_query_uninitialized", Self(TrapCode::RayQueryUninitialized)),
        ("ray_query_complete", Self(TrapCode::RayQueryComplete)),
        ("ray_query_no_candidate", Self(TrapCode::RayQueryNoCandidate)),
        ("ray_query_no_committed", Self(TrapCode::RayQueryNoCommitted)),
        ("ray_query_not_triangle", Self(TrapCode::RayQueryNotTriangle)),
        ("ray_query_not_aabb", Self(TrapCode::RayQueryNotAabb)),
        ("ray_query_outside_interval", Self(TrapCode::RayQueryOutsideInterval)),
        ("invalid_hit_object", Self(TrapCode::InvalidHitObject)),
        ("hit_object_no_primitive", Self(TrapCode::HitObjectNoPrimitive)),
        ("hit_object_unrecorded", Self(TrapCode::HitObjectUnrecorded)),
        ("hit_object_empty", Self(TrapCode::HitObjectEmpty)),
        ("hit_object_not_hit", Self(TrapCode::HitObjectNotHit)),
        ("not_triangle", Self(TrapCode::NotTriangle)),
        ("not_sphere", Self(TrapCode::NotSphere)),
        ("not_linear_swept_sphere", Self(TrapCode::NotLinearSweptSphere)),
        ("barrier_divergence", Self(TrapCode::BarrierDivergence)),
    ];
}

impl Parse for TrapExpectation {
    fn parse(value: Value<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let code = table.required("code");
        let launch_id = table.optional("launch_id");
        let line = table.optional("line");
        let because = table.required("because");
        table.finish();
        Some(Self { code: code?, launch_id, line, because: because? })
    }
}

impl TrapExpectation {
    fn check(&self, trap: &Error, errors: &mut Vec<Error>) {
        if trap.message() != self.code.value.0.message() {
            let message = format!("another trap: {trap}");
            errors.push(differs(&self.code.span, message, &self.because));
            return;
        }
        if let Some(id) = &self.launch_id {
            let [x, y, z] = id.value;
            let wanted = format!(" id ({x}, {y}, {z})");
            if !trap.notes().iter().any(|note| note.ends_with(&wanted)) {
                errors.push(differs(&id.span, format!("another invocation trapped: {trap}"), &self.because));
            }
        }
        if let Some(line) = &self.line
            && line_of(trap) != Some(line.value)
        {
            errors.push(differs(&line.span, format!("trapped elsewhere: {trap}"), &self.because));
        }
    }
}

/// The source line that an error points at, where it knows one.
fn line_of(error: &Error) -> Option<u32> {
    error.places().find_map(|(place, _)| match place {
        Place::Line { line, .. } => Some(*line),
        Place::Text { text, span, .. } => Some(text[..span.start].matches('\n').count() as u32 + 1),
        _ => None,
    })
}

/// Numbers at a place of a buffer or an image.
#[derive(Clone, Debug)]
pub struct BytesExpectation {
    /// The resource's name in the scene.
    pub name: At<String>,
    /// Where the first number lies, in bytes.
    pub offset: usize,
    /// Bytes from one outermost element to the next; without it they follow each other.
    pub stride: Option<usize>,
    /// An image's first texel, x and y.
    pub at: [usize; 2],
    /// The numbers, by outermost element.
    pub numbers: Numbers,
    /// How exact.
    pub tolerance: Tolerance,
    /// Why.
    pub because: String,
}

impl Parse for BytesExpectation {
    fn parse(value: Value<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let name = table.required("name");
        let offset = table.or("offset", 0_u32) as usize;
        let stride = table.optional::<u32>("stride").map(|stride| stride as usize);
        let at = table.or("at", [0_u32; 2]).map(|side| side as usize);
        let tolerance = Tolerance::of(&table);
        let numbers = Numbers::of(&table);
        let because = table.required("because");
        table.finish();
        let (tolerance, numbers) = (tolerance?, numbers?);
        Some(Self { name: name?, offset, stride, at, numbers, tolerance, because: because? })
    }
}

impl BytesExpectation {
    fn check(&self, memory: &[Bytes], errors: &mut Vec<Error>) {
        let Some(found) = memory.iter().find(|bytes| bytes.name == self.name.value) else {
            let message = format!("there is no resource `{}` of this kind", self.name.value);
            errors.push(differs(&self.name.span, message, &self.because));
            return;
        };
        let [width, texel] = found.row.unwrap_or_default();
        let start = self.offset + (self.at[1] * width + self.at[0]) * texel;
        let scalar = self.numbers.scalar;
        let (mut count, before) = (0, errors.len());
        for (index, element) in self.numbers.elements.iter().enumerate() {
            let packed = self.numbers.elements[..index].iter().map(|one| one.len() * scalar.size()).sum();
            let first = start + self.stride.map_or(packed, |stride| index * stride);
            for (position, expected) in element.iter().enumerate() {
                let offset = first + position * scalar.size();
                let Some(bits) = scalar.load(&found.bytes, offset) else {
                    let message =
                        format!("byte {offset} of `{}`, which has {}", found.name, found.bytes.len());
                    errors.push(differs(&expected.span, message, &self.because));
                    return;
                };
                if let Some(message) = self.tolerance.difference(scalar, &expected.value, bits) {
                    count += 1;
                    if count <= SHOWN {
                        let place = found.describe(offset);
                        errors.push(differs(&expected.span, format!("{place}: {message}"), &self.because));
                    }
                }
            }
        }
        if count > SHOWN {
            let last = errors.pop().expect("bug in anyhit: a difference was counted, not kept");
            errors.push(last.note(format!("{} more differences in this table", count - SHOWN)));
        }
        debug_assert!(errors.len() - before <= SHOWN);
    }
}

impl Bytes {
    fn describe(&self, offset: usize) -> String {
        match self.row {
            None => format!("`{}` at byte {offset}", self.name),
            Some([width, texel]) => {
                let (index, rest) = (offset / texel, offset % texel);
                format!("`{}` at texel ({}, {}) byte {rest}", self.name, index % width, index / width)
            }
        }
    }
}

/// The hit record of a ray of the scene.
#[derive(Clone, Debug)]
pub struct RayExpectation {
    /// The ray's name.
    pub name: At<String>,
    /// The hit; `None` for a miss.
    pub hit: Option<HitExpectation>,
    /// How exact t and attributes are.
    pub tolerance: Tolerance,
    /// Why.
    pub because: String,
}

/// A hit, in the parts that count.
#[derive(Clone, Debug)]
pub struct HitExpectation {
    /// `InstanceId`, `RayGeometryIndexKHR`, `PrimitiveId`, `HitKindKHR`.
    pub numbers: [Option<At<u32>>; 4],
    /// The hit distance.
    pub t: Option<At<Expected>>,
    /// The hit attributes of a triangle or a linear swept sphere.
    pub attributes: Vec<At<Expected>>,
}

impl Parse for RayExpectation {
    fn parse(value: Value<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let name = table.required("name");
        let miss = table.or("miss", false);
        let numbers = ["instance", "geometry", "primitive", "kind"].map(|key| table.optional(key));
        let float = |value| Expected::parse(value, Scalar::F32);
        let t = table.value("t").and_then(float);
        let attributes = table.value("attributes");
        let attributes: Vec<_> =
            attributes.and_then(|value| value.elements()).into_iter().flatten().filter_map(float).collect();
        let hit = HitExpectation { numbers, t, attributes };
        let nothing = hit.numbers.iter().all(Option::is_none) && hit.t.is_none() && hit.attributes.is_empty();
        let tolerance = Tolerance::of(&table);
        let because = table.required("because");
        table.finish();
        if miss != nothing {
            return value.wrong("a ray either misses (`miss = true`) or hits (`primitive`, `t`, ...)");
        }
        Some(Self { name: name?, hit: (!miss).then_some(hit), tolerance: tolerance?, because: because? })
    }
}

impl RayExpectation {
    fn check(&self, observed: &Observed, errors: &mut Vec<Error>) {
        let mut push = |span: &Span, message: String| errors.push(differs(span, message, &self.because));
        let name = &self.name;
        let found = observed.rays.iter().find(|(known, _)| known.as_ref() == Some(&name.value));
        let committed = match found {
            None => return push(&name.span, format!("the scene has no ray `{}`", name.value)),
            Some((_, Err(trap))) => return push(&name.span, format!("the ray trapped: {trap}")),
            Some((_, Ok(committed))) => committed,
        };
        let (hit, committed) = match (&self.hit, committed) {
            (None, None) => return,
            (None, Some(hit)) => return push(&name.span, format!("the ray hits {hit:?}")),
            (Some(_), None) => return push(&name.span, "the ray misses".into()),
            (Some(hit), Some(committed)) => (hit, committed),
        };
        let candidate = &committed.candidate;
        let numbers = [candidate.instance, candidate.geometry, candidate.primitive, committed.hit_kind.0];
        let names = ["instance", "geometry", "primitive", "hit kind"];
        for ((expected, found), name) in hit.numbers.iter().zip(numbers).zip(names) {
            if let Some(expected) = expected
                && expected.value != found
            {
                push(&expected.span, format!("{name}: expected {}, found {found}", expected.value));
            }
        }
        let attributes = hit.attributes.iter().zip(candidate.intersection.attributes);
        for (expected, found) in hit.t.iter().map(|t| (t, committed.t)).chain(attributes) {
            let bits = u64::from(found.to_bits());
            if let Some(message) = self.tolerance.difference(Scalar::F32, &expected.value, bits) {
                push(&expected.span, message);
            }
        }
    }
}

/// How often shaders run.
#[derive(Clone, Debug)]
pub struct StatsExpectation {
    /// Counts of the whole launch, each with what counts it.
    pub totals: Vec<(Total, At<u64>)>,
    /// Invocations by stage.
    pub invocations: Vec<(Stage, At<u64>)>,
    /// Why.
    pub because: String,
}

/// A count of the whole launch.
type Total = fn(&Stats) -> u64;

const TOTALS: [(&str, Total); 3] = [
    ("rays", |stats| stats.rays),
    ("ray_queries", |stats| stats.ray_queries),
    ("reorders", |stats| stats.reorders),
];

const STAGES: [(&str, Stage); 7] = [
    ("ray_generation", Stage::RayGeneration),
    ("intersection", Stage::Intersection),
    ("any_hit", Stage::AnyHit),
    ("closest_hit", Stage::ClosestHit),
    ("miss", Stage::Miss),
    ("callable", Stage::Callable),
    ("compute", Stage::Compute),
];

impl Parse for StatsExpectation {
    fn parse(value: Value<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let totals = TOTALS.map(|(key, total)| table.optional(key).map(|count| (total, count)));
        let counts = STAGES.map(|(key, stage)| table.optional(key).map(|count| (stage, count)));
        let because = table.required("because");
        table.finish();
        Some(Self {
            totals: totals.into_iter().flatten().collect(),
            invocations: counts.into_iter().flatten().collect(),
            because: because?,
        })
    }
}

impl StatsExpectation {
    fn check(&self, stats: &Stats, errors: &mut Vec<Error>) {
        let invocations = self.invocations.iter().map(|(stage, expected)| {
            (expected, stats.shaders.get(stage).map_or(0, |stats| stats.invocations))
        });
        let totals = self.totals.iter().map(|(total, expected)| (expected, total(stats)));
        for (expected, found) in totals.chain(invocations) {
            if expected.value != found {
                let message = format!("expected {}, found {found}", expected.value);
                errors.push(differs(&expected.span, message, &self.because));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{Candidate, HitKind};
    use crate::geometry::{Intersection, Surface};

    fn expect(text: &str) -> Expectations {
        let document = Document::parse("scene.toml", text).expect("TOML");
        Expectations::read(&document).expect("expectations")
    }

    fn observed() -> Observed {
        let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let floats = [1.0f32, 2.0, 3.0, 4.0].map(f32::to_bits);
        let intersection = Intersection { t: 2.5, attributes: [0.25, 0.0], surface: Surface::Side };
        let candidate = Candidate { instance: 1, geometry: 0, primitive: 7, intersection, opaque: true };
        let hit = Committed { candidate, t: 2.5, hit_kind: HitKind::LINEAR_SWEPT_SPHERE };
        Observed {
            trap: None,
            buffers: vec![Bytes {
                name: "outputs".into(),
                binding: [0, 1, 0],
                row: None,
                bytes: words(&floats),
            }],
            images: vec![Bytes {
                name: "picture".into(),
                binding: [0, 2, 0],
                row: Some([2, 4]),
                bytes: words(&[10, 11, 12, 13]),
            }],
            rays: vec![(Some("a".into()), Ok(Some(hit))), (Some("b".into()), Ok(None))],
            stats: Some(Stats { rays: 3, ..Stats::default() }),
        }
    }

    fn difference(text: &str) -> String {
        expect(text).check(&observed()).expect_err("this expectation must not hold").render()
    }

    fn holds(text: &str) {
        expect(text).check(&observed()).expect("this expectation must hold");
    }

    const BECAUSE: &str = "because = 'arithmetic'\n";

    #[test]
    fn numbers_are_found_by_offset_and_stride() {
        holds(&format!("[[expect.buffer]]\nname = 'outputs'\nf32 = [1, [2, 3], 'any']\n{BECAUSE}"));
        holds(&format!(
            "[[expect.buffer]]\nname = 'outputs'\noffset = 4\nstride = 8\nf32 = [[2], [4]]\n{BECAUSE}"
        ));
        holds(&format!("[[expect.image]]\nname = 'picture'\nat = [1, 0]\nu32 = [11, 12]\n{BECAUSE}"));
        let text = difference(&format!(
            "[[expect.buffer]]\nname = 'outputs'\nf32 = [1, 2.5]\nabsolute = 0.25\n{BECAUSE}"
        ));
        assert!(text.contains("`outputs` at byte 4: expected 2.5"), "{text}");
        assert!(text.contains("found 2.0") && text.contains("5e-1 away and 2.5e-1 allowed"), "{text}");
        assert!(text.contains("scene.toml:3:11") && text.contains("because: arithmetic"), "{text}");
        let text =
            difference(&format!("[[expect.image]]\nname = 'picture'\nat = [1, 0]\nu32 = [11, 9]\n{BECAUSE}"));
        assert!(text.contains("`picture` at texel (0, 1) byte 0: expected 9, found 12"), "{text}");
    }

    #[test]
    fn what_is_not_there_is_a_difference() {
        let text =
            difference(&format!("[[expect.buffer]]\nname = 'outputs'\noffset = 12\nf32 = [4, 5]\n{BECAUSE}"));
        assert!(text.contains("byte 16 of `outputs`, which has 16"), "{text}");
        let text = difference(&format!("[[expect.buffer]]\nname = 'output'\nf32 = 1\n{BECAUSE}"));
        assert!(text.contains("there is no resource `output`"), "{text}");
    }

    #[test]
    fn of_many_differences_some_are_shown_and_all_counted() {
        let text = difference(&format!(
            "[[expect.buffer]]\nname = 'outputs'\nu8 = [{}]\n{BECAUSE}",
            "9, ".repeat(16)
        ));
        assert_eq!(text.matches("expected 9").count(), SHOWN);
        assert!(text.contains("10 more differences in this table"), "{text}");
    }

    #[test]
    fn hits_and_misses_of_rays() {
        let ray = |rest: &str| format!("[[expect.ray]]\n{rest}\n{BECAUSE}");
        holds(&ray("name = 'a'\ninstance = 1\nprimitive = 7\nkind = 0x81\nt = 2.5\nattributes = [0.25]"));
        holds(&ray("name = 'b'\nmiss = true"));
        assert!(difference(&ray("name = 'a'\nprimitive = 8")).contains("primitive: expected 8, found 7"));
        assert!(difference(&ray("name = 'a'\nt = 2.25")).contains("expected 2.25"));
        assert!(difference(&ray("name = 'a'\nmiss = true")).contains("the ray hits"));
        assert!(difference(&ray("name = 'b'\nt = 1")).contains("the ray misses"));
        assert!(difference(&ray("name = 'c'\nt = 1")).contains("the scene has no ray `c`"));
    }

    #[test]
    fn traps_and_counts() {
        let trap =
            format!("[expect.trap]\ncode = 'budget_spent'\nline = 3\nlaunch_id = [1, 0, 0]\n{BECAUSE}");
        assert!(difference(&trap).contains("no trap; expected: the instruction budget is spent"));
        let with = |code: TrapCode, line: u32, id: &str| {
            let place = Place::Line { file: "a.rgen".into(), line, column: 0 };
            let error = Error::new(ErrorKind::Trap, code.message()).at(place).note(format!("launch id {id}"));
            let observed = Observed { trap: Some(error), ..observed() };
            expect(&trap).check(&observed).map_err(|error| error.render())
        };
        assert_eq!(with(TrapCode::BudgetSpent, 3, "(1, 0, 0)"), Ok(()));
        assert!(with(TrapCode::Unreachable, 3, "(1, 0, 0)").unwrap_err().contains("another trap"));
        assert!(with(TrapCode::BudgetSpent, 4, "(1, 0, 0)").unwrap_err().contains("trapped elsewhere"));
        assert!(with(TrapCode::BudgetSpent, 3, "(2, 0, 0)").unwrap_err().contains("another invocation"));
        assert!(difference(&format!("[expect.stats]\nrays = 4\n{BECAUSE}")).contains("expected 4, found 3"));
        let error = Error::new(ErrorKind::Trap, TrapCode::Unreachable.message());
        let observed = Observed { trap: Some(error), ..observed() };
        assert!(expect("").check(&observed).is_err());
    }

    #[test]
    fn a_known_failure_fails_when_it_passes() {
        let text = |value| {
            format!(
                "[expect]\nknown_failure = 'a gap'\n[[expect.buffer]]\nname = 'outputs'\nf32 = {value}\n{BECAUSE}"
            )
        };
        holds(&text(9));
        assert!(difference(&text(1)).contains("this known failure passes: take it out"));
    }

    #[test]
    fn expectations_give_reasons_and_one_type() {
        let mistake = |text: &str| {
            let document = Document::parse("scene.toml", text).expect("TOML");
            Expectations::read(&document).expect_err("a mistake").render()
        };
        assert!(mistake("[[expect.buffer]]\nname = 'a'\nf32 = 1\n").contains("`because` is missing"));
        assert!(
            mistake("[[expect.buffer]]\nname = 'a'\nbecause = 'x'\n")
                .contains("numbers of one type are needed")
        );
        assert!(
            mistake("[expect.trap]\ncode = 'budget'\nbecause = 'x'\n")
                .contains("did you mean `budget_spent`?")
        );
        assert!(
            mistake("[[expect.buffer]]\nname = 'a'\nf32 = 1\nulp = 1\nabsolute = 1\nbecause = 'x'\n")
                .contains("one of `ulp`, `absolute` and `relative`")
        );
    }
}
