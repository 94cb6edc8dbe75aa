//! The transcript of a ray or an invocation: a tree of plain data, from which text and JSON are
//! made.
//!
//! The JSON of `anyhit trace-one-ray --json` is this tree, field by field; `docs/trace-one-ray.md`
//! describes it. A change that could break a reader of it raises [`VERSION`].

use std::collections::BTreeMap;

use serde::Serialize;

use crate::debug::values::{FloatValue, TypedValue};

/// The version of the JSON.
pub const VERSION: u32 = 1;

/// One launch invocation or one ray, with all that followed from it.
#[derive(Clone, Debug, Serialize)]
pub struct Transcript {
    /// [`VERSION`].
    pub version: u32,
    /// The scene's file.
    pub scene: String,
    /// The name of the scene's `[[ray]]`, where it was one with a name.
    pub ray_name: Option<String>,
    /// The launch index; `None` for a ray that no shader traced.
    pub launch: Option<LaunchIndex>,
    /// What ran: the ray generation shader, or the ray.
    pub root: Step,
    /// What changed in buffers and images.
    pub writes: Vec<MemoryChange>,
    /// Writes beyond those listed.
    pub writes_left_out: usize,
    /// What shaders printed (`NonSemantic.DebugPrintf`); left out where that is nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub printed: Vec<String>,
    /// Rays and shaders counted.
    pub counts: RunCounts,
    /// The trap that ended it, where one did.
    pub trap: Option<TrapReport>,
}

/// Which invocation of a launch.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LaunchIndex {
    /// `LaunchIdKHR`
    pub id: [u32; 3],
    /// `LaunchSizeKHR`
    pub size: [u32; 3],
}

/// How much was done.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunCounts {
    /// Rays traced.
    pub rays: u64,
    /// Ray queries initialised.
    pub ray_queries: u64,
    /// Shader runs by execution model.
    pub shaders: BTreeMap<&'static str, u64>,
}

/// The report of a trap.
#[derive(Clone, Debug, Serialize)]
pub struct TrapReport {
    /// One line.
    pub message: String,
    /// Where and by whom called.
    pub notes: Vec<String>,
    /// The whole report as the terminal shows it.
    pub report: String,
}

/// Something that a shader did, in order.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Step {
    /// `OpTraceRayKHR`
    Trace(Box<Trace>),
    /// A ray query, from `OpRayQueryInitializeKHR` on: all that it did until the shader ended or
    /// initialised it again.
    RayQuery(Box<QueryReport>),
    /// A shader that it called: a callable one, any-hit for a report, closest-hit or miss of a hit
    /// object.
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
    /// The shader.
    pub shader: ShaderLabel,
    /// The builtins that it reads.
    pub builtins: Vec<NamedValue>,
    /// The hit attributes that it declares.
    pub attributes: Option<TypedValue>,
    /// The payload (or callable data) that it declares, as it was given.
    pub payload_before: Option<TypedValue>,
    /// The payload (or callable data) that the shader left.
    pub payload_after: Option<TypedValue>,
    /// What the shader did, in order.
    pub steps: Vec<Step>,
    /// How the shader ended.
    pub exit: Ending,
}

/// A builtin with its value.
#[derive(Clone, Debug, Serialize)]
pub struct NamedValue {
    /// The specification's name.
    pub name: &'static str,
    /// Its value.
    #[serde(flatten)]
    pub value: TypedValue,
}

/// Which shader.
#[derive(Clone, Debug, Serialize)]
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
pub struct Ending {
    /// The kind of ending.
    pub how: ExitKind,
    /// What went wrong, for a trap.
    pub message: Option<&'static str>,
    /// Where, for a trap.
    pub at: Option<TranscriptLine>,
}

/// How a shader ended, in a word.
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

/// A line of a source.
#[derive(Clone, Debug, Serialize)]
pub struct TranscriptLine {
    /// The file's name as the compiler wrote it.
    pub file: String,
    /// From 1.
    pub line: u32,
    /// The line without its indent, where the module holds the source.
    pub text: Option<String>,
}

/// One ray.
#[derive(Clone, Debug, Serialize)]
pub struct Trace {
    /// 1 for a ray of ray generation, or from the host.
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
    /// What shaders decided, in order.
    pub decisions: Vec<Decision>,
    /// The closest hit; `None` for a miss.
    pub hit: Option<HitReport>,
    /// The record of the hit or miss table; `None` where a trap came first.
    pub record: Option<RecordChoice>,
    /// The closest-hit or miss shader.
    pub shader: Option<Box<ShaderRun>>,
    /// Why none ran.
    pub no_shader: Option<String>,
}

/// One ray query.
#[derive(Clone, Debug, Serialize)]
pub struct QueryReport {
    /// The ray and what it met.
    #[serde(flatten)]
    pub traversal: Traversal,
    /// What `OpRayQueryProceedKHR` showed, in order.
    pub candidates: Vec<QueryCandidate>,
    /// The committed hit; `None` where nothing was committed.
    pub hit: Option<HitReport>,
    /// How far it came.
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
    /// Where; for a box its entry.
    pub t: FloatValue,
    /// Whether it is a box.
    pub is_box: bool,
    /// Whether a hit of it is opaque.
    pub opaque: bool,
    /// Whether it was confirmed.
    pub confirmed: bool,
    /// The hits that were generated in it.
    pub generated: Vec<FloatValue>,
}

/// How far a ray query came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum QueryEnd {
    /// The shader left it before its end.
    Underway,
    /// `OpRayQueryTerminateKHR`
    Terminated,
    /// `OpRayQueryProceedKHR` returned false.
    Complete,
}

/// A ray and what traversal saw of its way.
#[derive(Clone, Debug, Serialize)]
pub struct Traversal {
    /// The acceleration structure's name.
    pub structure: Option<String>,
    /// Where a shader traced it.
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
    /// `CurrentRayTimeNV`; `None` where nothing moves and the ray names no time.
    pub time: Option<FloatValue>,
    /// Nodes opened of the tree over the instances.
    pub nodes: u64,
    /// Every instance: what became of it.
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

/// What became of an instance.
#[derive(Clone, Debug, Serialize)]
pub struct InstanceReport {
    /// `InstanceId`
    pub instance: u32,
    /// Names of its geometries in the scene.
    pub geometry: Vec<String>,
    /// What it is made of.
    pub primitive_kind: Option<String>,
    /// How many primitives it has.
    pub primitives: usize,
    /// Its mask.
    pub mask: u8,
    /// `InstanceCustomIndexKHR`
    pub custom_index: u32,
    /// Whether its transform is not the identity.
    pub transformed: bool,
    /// Whether it or its vertices move while time goes from 0 to 1.
    pub moves: bool,
    /// The decision.
    pub verdict: InstanceOutcome,
    /// Nodes opened of its tree.
    pub nodes: u64,
    /// Primitives that were tested, in that order.
    pub tested: Vec<PrimitiveReport>,
}

/// Why an instance was kept or dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum InstanceOutcome {
    /// Its primitives are looked at.
    Entered,
    /// Its mask and the ray's cull mask share no bit.
    Masked,
    /// The ray's flags skip its kind of primitive.
    Skipped,
    /// The ray passes by the box around all its primitives.
    MissedBox,
    /// Traversal did not come to it: its box in the tree over the instances was missed or lies
    /// behind a hit, or a hit ended the traversal.
    NotReached,
}

/// What became of a primitive.
#[derive(Clone, Debug, Serialize)]
pub struct PrimitiveReport {
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
    /// The decision.
    pub verdict: PrimitiveOutcome,
    /// Where the ray meets it, where it does.
    pub t: Option<FloatValue>,
    /// Which surface.
    pub surface: Option<&'static str>,
    /// The t of the hit that it lies behind.
    pub behind: Option<FloatValue>,
}

/// Why a primitive was kept or dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PrimitiveOutcome {
    /// An opaque hit, the closest so far.
    Opaque,
    /// A candidate for the shaders.
    Candidate,
    /// Behind a hit that was known already.
    Behind,
    /// The ray meets it before t_min or after t_max.
    OutsideInterval,
    /// The opacity micromap is transparent there.
    Transparent,
    /// The ray's flags cull its opacity.
    CulledByOpacity,
    /// The ray's flags cull the side that it shows.
    CulledByFace,
    /// The ray does not meet it.
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
    /// Where; for a box its entry.
    pub t: FloatValue,
    /// Whether it is a box.
    pub is_box: bool,
    /// The hit record.
    pub record: RecordChoice,
    /// The any-hit or intersection shader; `None` where the record has none.
    pub shader: Option<ShaderRun>,
}

/// A record of the shader binding table and how it was found.
#[derive(Clone, Debug, Serialize)]
pub struct RecordChoice {
    /// `hit` or `miss`.
    pub table: &'static str,
    /// Its index.
    pub index: u64,
    /// How the index of a hit record comes about.
    pub arithmetic: Option<Arithmetic>,
    /// How many records the table has.
    pub records: usize,
    /// The scene's name for it.
    pub name: Option<String>,
    /// The index of its group; `None` for a null handle, or no record.
    pub group: Option<u32>,
}

/// instance offset + geometry * stride + offset
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
    /// Descriptor set.
    pub set: u32,
    /// The binding number in the set.
    pub binding: u32,
    /// Where in it.
    pub at: ChangedPlace,
    /// The path of what changed in a buffer's type, where that is known.
    pub member: Option<String>,
    /// The value before the run.
    pub before: TypedValue,
    /// The value after the run.
    pub after: TypedValue,
}

/// Where in a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangedPlace {
    /// x, y, and the depth or layer.
    Texel([u32; 3]),
    /// The offset of the first byte.
    Byte(u64),
}
