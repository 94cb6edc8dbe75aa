//! The transcript of a ray or an invocation: a tree of plain data, from which text and JSON are
//! made.
//!
//! The JSON of `anyhit trace-one-ray --json` is this tree, field by field; `docs/trace-one-ray.md`
//! describes it. A change that could break a reader of it raises [`VERSION`].

use serde::Serialize;

use crate::executed_lines::{ExecutedLine, PrintedText};
use crate::given_block::GivenBlock;
use anyhit_base::error::{ErrorReport, Place};
use anyhit_base::sorted::SortedMap;
use anyhit_engine::reflect::value::{FloatValue, TypedValue};

/// The version of the JSON.
pub const VERSION: u32 = 1;

/// One launch invocation or one ray, with all rays and shaders that followed from it.
#[derive(Clone, Debug, Serialize)]
pub struct Transcript {
    /// [`VERSION`].
    pub version: u32,
    /// The scene's file.
    pub scene: String,
    /// The name of the scene's `[[ray]]`, if it has one.
    pub ray_name: Option<String>,
    /// The pass, by its name or number, of a scene with several; omitted for others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pass: Option<String>,
    /// The launch index; `None` for a ray from the host.
    pub launch: Option<LaunchIndex>,
    /// What happened in short, a line each.
    pub summary: Vec<SummaryLine>,
    /// Known reasons of surprise that the facts below show.
    pub hints: Vec<Hint>,
    /// The invocation of a dispatch; omitted for launches and rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dispatch: Option<DispatchIndex>,
    /// The ray generation or compute shader, or the ray.
    pub root: Step,
    /// Changes in buffers and images.
    pub writes: Vec<MemoryChange>,
    /// The number of changes that are not listed.
    pub writes_left_out: usize,
    /// What shaders printed (`NonSemantic.DebugPrintf`); omitted if empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub printed: Vec<String>,
    /// Rays and shaders counted.
    pub counts: RunCounts,
    /// The trap that ended the run, if one did.
    pub trap: Option<ErrorReport>,
    /// Whether more lines ran than are followed, so that `lines` of shader runs end early; omitted
    /// where all were.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub lines_cut: bool,
}

/// A line of the summary.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SummaryLine {
    /// What it is about: `ray`, `payload`, `wrote`, `ran`, `printed`, `trap`.
    pub about: &'static str,
    /// The line.
    pub text: String,
}

/// A known reason of surprise, which facts of the transcript show.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Hint {
    /// Which one.
    pub kind: HintKind,
    /// It in words, with the numbers.
    pub text: String,
}

/// A pattern that is known to surprise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HintKind {
    /// A ray hits the primitive that it starts on.
    SelfIntersection,
    /// A ray begins at a hit point, with `RayTminKHR` 0.
    StartsOnSurface,
    /// A shader left a NaN in the payload or in memory.
    NanWritten,
    /// The ray's cull mask has no bit.
    EmptyCullMask,
    /// The masks of all instances share no bit with the ray's cull mask.
    AllMasked,
    /// The structure has no instance.
    EmptyStructure,
    /// The ray meets primitives outside its interval alone.
    OnlyOutsideInterval,
    /// The ray's flags cull all that it meets.
    AllCulled,
    /// Any-hit shaders ignored all that the ray meets.
    AllIgnored,
    /// The record that was chosen is a null handle, or the table lacks it.
    NoRecord,
    /// A shader reads t as a distance, and the direction's length is not 1.
    DirectionLength,
    /// A variable named for a normal points along the ray.
    NormalAlongRay,
    /// A ray query came to candidates, confirmed none and generated no hit.
    UndecidedCandidates,
    /// An intersection shader of a transformed instance reads the ray in world space alone.
    WorldRay,
    /// A ray has the time 0, and the one before it another.
    TimeLost,
}

/// An invocation of a launch.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LaunchIndex {
    /// `LaunchIdKHR`
    pub id: [u32; 3],
    /// `LaunchSizeKHR`
    pub size: [u32; 3],
}

/// An invocation of a dispatch.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DispatchIndex {
    /// Which dispatch of the scene, from 0.
    pub dispatch: usize,
    /// `GlobalInvocationId`
    pub id: [u32; 3],
    /// `NumWorkgroups`
    pub groups: [u32; 3],
    /// `WorkgroupSize`
    pub workgroup_size: [u32; 3],
}

/// Counts of rays and shaders.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunCounts {
    /// Rays traced.
    pub rays: u64,
    /// Ray queries initialised.
    pub ray_queries: u64,
    /// Shader runs by execution model.
    pub shaders: SortedMap<&'static str, u64>,
}

/// An observed action of a shader.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Step {
    /// `OpTraceRayKHR`
    Trace(Box<Trace>),
    /// A ray query, from `OpRayQueryInitializeKHR` on: all that it did until the shader ended or
    /// initialised it again.
    RayQuery(Box<QueryReport>),
    /// A shader that it called: a callable shader, any-hit for a report, or closest-hit or miss of
    /// a hit object.
    Shader(Box<ShaderRun>),
    /// `OpReportIntersectionKHR`
    Report {
        /// The hit distance.
        t: FloatValue,
        /// The hit kind.
        hit_kind: u32,
        /// Whether it became the closest hit.
        accepted: bool,
    },
}

/// One run of a shader.
#[derive(Clone, Debug, Serialize)]
pub struct ShaderRun {
    /// How many shaders had begun before it.
    pub run: u64,
    /// The shader.
    pub shader: ShaderLabel,
    /// The builtins that it reads.
    pub builtins: Vec<NamedValue>,
    /// The hit attributes that it declares.
    pub attributes: Option<TypedValue>,
    /// The data of its record, if it declares some; omitted otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record: Option<RecordData>,
    /// The push constants, if it declares some; omitted otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub push_constants: Option<GivenBlock>,
    /// The payload (or callable data) that it declares, before the run.
    pub payload_before: Option<TypedValue>,
    /// The payload (or callable data) after the run.
    pub payload_after: Option<TypedValue>,
    /// The shader's actions, in order.
    pub steps: Vec<Step>,
    /// The lines that ran, in the order in which they first did; omitted where they were not
    /// followed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<ExecutedLine>,
    /// What it printed; omitted if nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub printed: Vec<PrintedText>,
    /// How the shader ended.
    pub exit: ShaderExit,
}

/// The data of a shader record as a shader declares it (`ShaderRecordBufferKHR`).
#[derive(Clone, Debug, Serialize)]
pub struct RecordData {
    /// The bytes that the record has.
    pub given: u64,
    /// The bytes that the shader declares.
    pub declared: u64,
    /// What it declares, in order; a long list is cut.
    pub members: Vec<RecordMember>,
    /// The words behind those that it declares; a long list is cut.
    pub behind: Vec<u32>,
}

/// A scalar or vector in the data of a shader record.
#[derive(Clone, Debug, Serialize)]
pub struct RecordMember {
    /// Its path from the block: `values[1]`.
    pub member: String,
    /// The offset of its first byte.
    pub byte: u64,
    /// Its value; `None` where the record ends before it does.
    pub value: Option<TypedValue>,
}

/// A builtin with its value.
#[derive(Clone, Debug, Serialize)]
pub struct NamedValue {
    /// The specification's name.
    pub name: &'static str,
    /// What the language of the shader's source calls it; omitted where that is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source_name: Option<&'static str>,
    /// Its value.
    #[serde(flatten)]
    pub value: TypedValue,
}

/// Names of a shader.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ShaderLabel {
    /// The execution model.
    pub stage: &'static str,
    /// The scene's name.
    pub name: Option<String>,
    /// The file's name.
    pub file: Option<String>,
    /// The entry point.
    pub entry: String,
}

/// How a shader ended.
#[derive(Clone, Debug, Serialize)]
pub struct ShaderExit {
    /// The kind of ending.
    pub how: ExitKind,
    /// The message of a trap.
    pub message: Option<&'static str>,
    /// The source line of a trap.
    pub at: Option<TranscriptLine>,
}

/// The way in which a shader ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ExitKind {
    /// The shader ran to its end.
    Returned,
    /// `OpIgnoreIntersectionKHR`
    Ignored,
    /// `OpTerminateRayKHR`
    Terminated,
    /// A trap stopped the shader.
    Trapped,
}

/// A line of a shader's source.
#[derive(Clone, Debug, Serialize)]
pub struct TranscriptLine {
    /// The file's name as the compiler wrote it.
    pub file: String,
    /// The line's number, from 1.
    pub line: u32,
    /// The line's text without its indent, if the module holds the source.
    pub text: Option<String>,
}

impl TranscriptLine {
    /// The line of a place; `None` for a place that is in no text.
    pub fn of(place: &Place) -> Option<Self> {
        let (file, line) = place.file_line()?;
        let text = match place {
            Place::Text { text, span, .. } => text.get(span.clone()).map(str::to_owned),
            _ => None,
        };
        Some(Self { file: file.to_owned(), line, text })
    }
}

/// A traced ray.
#[derive(Clone, Debug, Serialize)]
pub struct Trace {
    /// The recursion depth: 1 for a ray of ray generation, or from the host.
    pub depth: u32,
    /// The ray and what it met.
    #[serde(flatten)]
    pub traversal: Traversal,
    /// SBT offset.
    pub sbt_offset: u32,
    /// SBT stride.
    pub sbt_stride: u32,
    /// Miss index.
    pub miss_index: u32,
    /// The caller's payload before the trace.
    pub payload_before: Option<TypedValue>,
    /// The caller's payload after the trace.
    pub payload_after: Option<TypedValue>,
    /// The shaders' decisions on candidates, in order.
    pub decisions: Vec<Decision>,
    /// The closest hit; `None` for a miss.
    pub hit: Option<HitReport>,
    /// The record of the hit or miss table; `None` if a trap ended the ray before.
    pub record: Option<RecordChoice>,
    /// The closest-hit or miss shader.
    pub shader: Option<Box<ShaderRun>>,
    /// Why no closest-hit or miss shader ran.
    pub no_shader: Option<String>,
}

/// A ray query.
#[derive(Clone, Debug, Serialize)]
pub struct QueryReport {
    /// The ray and what it met.
    #[serde(flatten)]
    pub traversal: Traversal,
    /// The candidates at which `OpRayQueryProceedKHR` stopped, in order.
    pub candidates: Vec<QueryCandidate>,
    /// The committed hit, if there is one.
    pub hit: Option<HitReport>,
    /// How the query ended.
    pub end: QueryEnd,
}

/// A candidate of a ray query and what the shader did with it.
#[derive(Clone, Debug, Serialize)]
pub struct QueryCandidate {
    /// `InstanceId`
    pub instance: u32,
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
    /// The hit distance; for a box the distance at which the ray enters it.
    pub t: FloatValue,
    /// Whether the primitive is a box.
    pub is_box: bool,
    /// Whether a hit of it is opaque.
    pub opaque: bool,
    /// Whether it was confirmed.
    pub confirmed: bool,
    /// The hits that were generated in it.
    pub generated: Vec<FloatValue>,
}

/// How a ray query ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum QueryEnd {
    /// The shader ended before the traversal was complete.
    Underway,
    /// `OpRayQueryTerminateKHR`
    Terminated,
    /// `OpRayQueryProceedKHR` returned false.
    Complete,
}

/// A ray, and the instances and primitives that its traversal tested.
#[derive(Clone, Debug, Serialize)]
pub struct Traversal {
    /// The acceleration structure's name.
    pub structure: Option<String>,
    /// The source line of the instruction that traces it.
    pub called_at: Option<TranscriptLine>,
    /// The ray's origin.
    pub origin: [FloatValue; 3],
    /// The ray's direction.
    pub direction: [FloatValue; 3],
    /// The direction's length, rounded.
    pub direction_length: FloatValue,
    /// `RayTminKHR`
    pub t_min: FloatValue,
    /// `RayTmaxKHR` at the start.
    pub t_max: FloatValue,
    /// Ray flags.
    pub flags: Flags,
    /// The cull mask.
    pub cull_mask: u32,
    /// `CurrentRayTimeNV`; `None` if nothing moves and the ray has no time.
    pub time: Option<FloatValue>,
    /// The number of nodes of the TLAS that were opened.
    pub nodes: u64,
    /// The verdict on every instance.
    pub instances: Vec<InstanceReport>,
}

/// Ray flags by number and name.
#[derive(Clone, Debug, Serialize)]
pub struct Flags {
    /// The bits.
    pub bits: u32,
    /// SPIR-V's names.
    pub names: Vec<String>,
}

/// The verdict on an instance and on its primitives.
#[derive(Clone, Debug, Serialize)]
pub struct InstanceReport {
    /// `InstanceId`
    pub instance: u32,
    /// Names of its geometries in the scene.
    pub geometry: Vec<String>,
    /// The kind of its primitives.
    pub primitive_kind: Option<String>,
    /// How many primitives it has.
    pub primitives: usize,
    /// Its mask.
    pub mask: u8,
    /// `InstanceCustomIndexKHR`
    pub custom_index: u32,
    /// The box around it in world space, at the ray's time: the least and the greatest coordinates;
    /// `None` where it is empty.
    pub bounds: Option<[[FloatValue; 3]; 2]>,
    /// Whether its transform is not the identity.
    pub transformed: bool,
    /// Whether it or its vertices move while time goes from 0 to 1.
    pub moves: bool,
    /// The decision.
    pub verdict: InstanceOutcome,
    /// The number of nodes of its BVH that were opened.
    pub nodes: u64,
    /// The primitives that were tested, in order.
    pub tested: Vec<PrimitiveReport>,
}

/// Why an instance was entered or rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum InstanceOutcome {
    /// Its primitives are tested.
    Entered,
    /// Its mask and the ray's cull mask share no bit.
    Masked,
    /// The ray's flags skip its kind of primitive.
    Skipped,
    /// The ray passes by the box around all its primitives.
    MissedBox,
    /// Traversal did not reach it: the ray misses its box in the TLAS, the box lies behind a hit,
    /// or a hit ended the traversal.
    NotReached,
}

/// The verdict on a primitive.
#[derive(Clone, Debug, Serialize)]
pub struct PrimitiveReport {
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
    /// The decision.
    pub verdict: PrimitiveOutcome,
    /// The t at which the ray hits it, if it does.
    pub t: Option<FloatValue>,
    /// The surface that the ray hits.
    pub surface: Option<&'static str>,
    /// The t of the closer hit that it lies behind.
    pub behind: Option<FloatValue>,
}

/// Why a primitive was accepted or rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PrimitiveOutcome {
    /// An opaque hit, the closest so far.
    Opaque,
    /// A candidate for the shaders.
    Candidate,
    /// Behind a hit that was found before.
    Behind,
    /// The ray hits it before t_min or after t_max.
    OutsideInterval,
    /// The opacity micromap is transparent there.
    Transparent,
    /// The ray's flags cull its opacity.
    CulledByOpacity,
    /// The ray's flags cull the side that it shows.
    CulledByFace,
    /// The ray misses it.
    Missed,
}

/// A candidate that a shader decided on.
#[derive(Clone, Debug, Serialize)]
pub struct Decision {
    /// `InstanceId`
    pub instance: u32,
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
    /// The hit distance; for a box the distance at which the ray enters it.
    pub t: FloatValue,
    /// Whether the primitive is a box.
    pub is_box: bool,
    /// The hit record.
    pub record: RecordChoice,
    /// The any-hit or intersection shader; `None` if the record has none.
    pub shader: Option<ShaderRun>,
}

/// A record of the shader binding table, and how its index was computed.
#[derive(Clone, Debug, Serialize)]
pub struct RecordChoice {
    /// The table: `hit` or `miss`.
    pub table: &'static str,
    /// The record's index.
    pub index: u64,
    /// The terms of the index of a hit record.
    pub arithmetic: Option<Arithmetic>,
    /// The number of records of the table.
    pub records: usize,
    /// The record's name in the scene.
    pub name: Option<String>,
    /// The index of its group; `None` for a null handle, or no record.
    pub group: Option<u32>,
}

/// The terms of instance offset + geometry * stride + offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Arithmetic {
    /// `instanceShaderBindingTableRecordOffset`
    pub instance_offset: u32,
    /// The geometry index.
    pub geometry: u32,
    /// The low 4 bits of the SBT stride.
    pub stride: u32,
    /// The low 4 bits of the SBT offset.
    pub offset: u32,
}

/// The closest hit.
#[derive(Clone, Debug, Serialize)]
pub struct HitReport {
    /// `InstanceId`
    pub instance: u32,
    /// `InstanceCustomIndexKHR`
    pub custom_index: u32,
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// The geometry's name in the scene.
    pub geometry_name: Option<String>,
    /// `PrimitiveId`
    pub primitive: u32,
    /// The ray parameter.
    pub t: FloatValue,
    /// `HitKindKHR`
    pub hit_kind: u32,
    /// The hit kind in words.
    pub hit_kind_name: String,
    /// Which surface was hit.
    pub surface: &'static str,
    /// Barycentrics of the second and third vertex, or u of a linear swept sphere.
    pub attributes: Vec<NamedValue>,
    /// origin + t * direction, rounded.
    pub position: [FloatValue; 3],
    /// The exact unit normal in world space, towards the ray's origin, rounded; `None` for a box.
    pub normal: Option<[FloatValue; 3]>,
    /// The exact unit normal in object space; `None` for a box.
    pub object_normal: Option<[FloatValue; 3]>,
    /// `ObjectRayOriginKHR`
    pub object_ray_origin: [FloatValue; 3],
    /// `ObjectRayDirectionKHR`
    pub object_ray_direction: [FloatValue; 3],
    /// The primitive's numbers in object space.
    pub data: Vec<NamedValue>,
}

/// A change in a buffer or an image.
#[derive(Clone, Debug, Serialize)]
pub struct MemoryChange {
    /// The scene's name of the resource.
    pub resource: String,
    /// Descriptor set; `None` for a buffer that is reached by its device address alone, and for
    /// what lies in a descriptor heap.
    pub set: Option<u32>,
    /// The binding number in the set.
    pub binding: Option<u32>,
    /// The location of the change in the resource.
    pub at: ChangeLocation,
    /// The path of the member that changed, if the buffer's type is known.
    pub member: Option<String>,
    /// The value before the run.
    pub before: TypedValue,
    /// The value after the run.
    pub after: TypedValue,
}

/// A location in a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeLocation {
    /// x, y, and the depth or layer.
    Texel([u32; 3]),
    /// The offset of the first byte.
    Byte(u64),
}
