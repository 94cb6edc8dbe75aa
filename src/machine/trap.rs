//! How an invocation ends.

use std::fmt;
use std::sync::Arc;

use crate::machine::device_memory::STRUCTURE_HANDLE;
use crate::machine::resource::{BindingSummary, Bindings};

/// Why an invocation was stopped by the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
#[non_exhaustive]
pub enum TrapCode {
    /// An index of an access chain is outside its array.
    IndexOutOfBounds,
    /// A load or store is outside its buffer.
    BufferOutOfBounds,
    /// An access through a null pointer.
    NullPointer,
    /// No buffer lies at a device address.
    AddressInvalid,
    /// A load or store through a device address goes beyond its buffer.
    AddressOutOfBounds,
    /// A device address is no multiple of what the instruction promises.
    AddressMisaligned,
    /// An atomic instruction on an offset that is no multiple of its size.
    AtomicMisaligned,
    /// No descriptor is bound, or one of another kind.
    DescriptorMissing,
    /// A texel coordinate is outside its image.
    ImageOutOfBounds,
    /// A texel of a row that the band of an image does not hold.
    ImageRowAbsent,
    /// The image bound has another dimension, sample count or component type than the shader
    /// declares.
    ImageMismatch,
    /// The sampler bound does not suit the instruction or the image.
    SamplerMismatch,
    /// `OpUnreachable` was reached.
    Unreachable,
    /// The invocation has executed as many instructions as its fuel allows.
    OutOfFuel,
    /// The invocations of the launch have executed as many instructions together as its fuel
    /// allows.
    LaunchOutOfFuel,
    /// The launch took longer than its `timeout`.
    LaunchTimedOut,
    /// Invocations that run together took longer than their `batch_timeout`.
    BatchTimedOut,
    /// The operands of a trace break a rule for rays; the report names it.
    InvalidTrace,
    /// The acceleration structure of a trace does not exist.
    AccelerationStructureMissing,
    /// `maxPipelineRayRecursionDepth` would be passed.
    RecursionTooDeep,
    /// The shaders of an invocation that call each other hold more registers than the stack has.
    StackOverflow,
    /// Callable shaders nest deeper than this machine goes.
    CallablesTooDeep,
    /// The shader binding table has no such record.
    ShaderRecordMissing,
    /// The data of a shader record is accessed, and it has none.
    ShaderRecordEmpty,
    /// The hit shader binding table has no record for what a ray met.
    HitRecordMissing,
    /// The miss shader binding table has no record of a ray's miss index.
    MissRecordMissing,
    /// A called shader takes a payload, or callable data, of another type than it is given.
    PayloadMismatch,
    /// The hit kind of a report is above 127 (VUID-RuntimeSpirv-OpReportIntersectionKHR-06998).
    InvalidHitKind,
    /// The operands of a ray query break a rule for rays; the report names it.
    InvalidRayQuery,
    /// A ray query is used before `OpRayQueryInitializeKHR`.
    RayQueryUninitialized,
    /// `OpRayQueryProceedKHR` after it returned false.
    RayQueryComplete,
    /// The candidate of a ray query is used, and there is none.
    RayQueryNoCandidate,
    /// The committed hit of a ray query is read, and there is none.
    RayQueryNoCommitted,
    /// An instruction for triangles reads another intersection of a ray query.
    RayQueryNotTriangle,
    /// An instruction for AABBs reads another candidate of a ray query.
    RayQueryNotAabb,
    /// An instruction for triangles reads another primitive.
    NotTriangle,
    /// An instruction for spheres reads another primitive.
    NotSphere,
    /// An instruction for linear swept spheres reads another primitive.
    NotLinearSweptSphere,
    /// `OpRayQueryGenerateIntersectionKHR` outside the ray's interval
    /// (VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06353).
    RayQueryOutsideInterval,
    /// A hit is generated in an acceleration structure with motion
    /// (VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06354).
    RayQueryMotion,
    /// A ray query in a structure with opacity micromaps, by a shader whose `OpacityMicromapIdKHR`
    /// is false.
    RayQueryMicromaps,
    /// `OpControlBarrier` that some invocations of the workgroup do not come to.
    BarrierDivergence,
    /// The operands of an instruction that records a hit object break a rule.
    InvalidHitObject,
    /// A recorded hit names a primitive that its acceleration structure does not have.
    HitObjectNoPrimitive,
    /// A hit object is used before anything was recorded in it.
    HitObjectUnrecorded,
    /// The ray or the shader record of an empty hit object is read.
    HitObjectEmpty,
    /// An instruction for hits reads a hit object that is none.
    HitObjectNotHit,
    /// An any-hit shader is null that the pipeline promises to have
    /// (VUID-vkCmdTraceRaysKHR-flags-03512).
    NullAnyHit,
    /// A closest-hit shader is null that the pipeline promises to have
    /// (VUID-vkCmdTraceRaysKHR-flags-03513).
    NullClosestHit,
    /// A miss shader is null that the pipeline promises to have
    /// (VUID-vkCmdTraceRaysKHR-flags-03511).
    NullMiss,
    /// An intersection shader is null that the pipeline promises to have
    /// (VUID-vkCmdTraceRaysKHR-flags-03514).
    NullIntersection,
    /// A shader that this one called trapped.
    Callee,
}

impl TrapCode {
    /// One line on what happened.
    pub fn message(self) -> &'static str {
        match self {
            Self::IndexOutOfBounds => "an index is outside its array",
            Self::BufferOutOfBounds => "a buffer is accessed outside its range",
            Self::NullPointer => "an access through a null pointer",
            Self::AddressInvalid => "no buffer lies at a device address",
            Self::AddressOutOfBounds => "a buffer is accessed beyond its end through a device address",
            Self::AddressMisaligned => "a device address is not aligned as the instruction promises",
            Self::AtomicMisaligned => "an atomic instruction on a misaligned offset",
            Self::DescriptorMissing => "no descriptor of this kind is bound here",
            Self::ImageOutOfBounds => "a texel coordinate is outside its image",
            Self::ImageRowAbsent => {
                "the texel is in a row of the image that is not there: the launch runs in bands of rows"
            }
            Self::ImageMismatch => {
                "the image bound here has another dimension, sample count or component type than the shader declares"
            }
            Self::SamplerMismatch => {
                "the sampler bound here does not suit: a comparison needs compare_op, \
                 unnormalized coordinates a 1D or 2D image (Vulkan, Instruction/Sampler/Image View Validation)"
            }
            Self::Unreachable => "OpUnreachable was reached",
            Self::OutOfFuel => "the invocation ran out of fuel: an endless loop?",
            Self::LaunchOutOfFuel => "the launch ran out of fuel: an endless loop?",
            Self::LaunchTimedOut => "the launch ran out of time: an endless loop?",
            Self::BatchTimedOut => "a batch of invocations ran out of time: an endless loop?",
            Self::InvalidTrace => "the operands of a trace break a rule",
            Self::AccelerationStructureMissing => "the acceleration structure of a trace does not exist",
            Self::RecursionTooDeep => "maxPipelineRayRecursionDepth is passed",
            Self::StackOverflow => "the stack of shaders that call each other is full: an endless recursion?",
            Self::CallablesTooDeep => "callable shaders call each other too deeply: an endless recursion?",
            Self::ShaderRecordMissing => "the shader binding table has no such record",
            Self::ShaderRecordEmpty => "the shader record holds no data: nothing follows its handle",
            Self::HitRecordMissing => "the hit shader binding table has no record for what the ray met",
            Self::MissRecordMissing => "the miss shader binding table has no record of the ray's miss index",
            Self::PayloadMismatch => {
                "a called shader takes a payload, or callable data, of another type than it is given"
            }
            Self::InvalidHitKind => {
                "the hit kind of a report is above 127 (VUID-RuntimeSpirv-OpReportIntersectionKHR-06998)"
            }
            Self::InvalidRayQuery => "the operands of a ray query break a rule",
            Self::RayQueryUninitialized => {
                "a ray query is used before OpRayQueryInitializeKHR (SPV_KHR_ray_query)"
            }
            Self::RayQueryComplete => {
                "OpRayQueryProceedKHR after it returned false: the ray query is complete (SPV_KHR_ray_query)"
            }
            Self::RayQueryNoCandidate => {
                "the candidate of a ray query is used, but the last OpRayQueryProceedKHR did not return true \
                 (SPV_KHR_ray_query)"
            }
            Self::RayQueryNoCommitted => {
                "the committed hit of a ray query is read, but nothing is committed (SPV_KHR_ray_query)"
            }
            Self::RayQueryNotTriangle => {
                "the intersection of a ray query is no triangle, as this instruction needs (SPV_KHR_ray_query)"
            }
            Self::RayQueryNotAabb => {
                "the candidate of a ray query is no AABB, as this instruction needs (SPV_KHR_ray_query)"
            }
            Self::NotTriangle => {
                "what was hit is no triangle, as this instruction needs (SPV_KHR_ray_tracing_position_fetch)"
            }
            Self::NotSphere => {
                "what was hit is no sphere, as this instruction needs (SPV_NV_linear_swept_spheres)"
            }
            Self::NotLinearSweptSphere => {
                "what was hit is no linear swept sphere, as this instruction needs (SPV_NV_linear_swept_spheres)"
            }
            Self::RayQueryOutsideInterval => {
                "the generated hit lies before t_min or behind the committed hit \
                 (VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06353)"
            }
            Self::RayQueryMotion => {
                "a hit is generated in an acceleration structure with motion \
                 (VUID-RuntimeSpirv-OpRayQueryGenerateIntersectionKHR-06354)"
            }
            Self::RayQueryMicromaps => {
                "a ray query in an acceleration structure with opacity micromaps, and the shader's execution mode \
                 OpacityMicromapIdKHR is false (SPV_KHR_opacity_micromap)"
            }
            Self::BarrierDivergence => {
                "a barrier that not every invocation of the workgroup comes to \
                 (SPIR-V, OpControlBarrier: only in uniform control flow)"
            }
            Self::InvalidHitObject => "the ray of a recorded hit object breaks a rule",
            Self::HitObjectNoPrimitive => {
                "a recorded hit names an instance, geometry or primitive that its acceleration structure does not have"
            }
            Self::HitObjectUnrecorded => {
                "a hit object is used before anything was recorded in it (SPV_EXT_shader_invocation_reorder)"
            }
            Self::HitObjectEmpty => {
                "an empty hit object has no ray and no shader record (SPV_EXT_shader_invocation_reorder)"
            }
            Self::HitObjectNotHit => {
                "what only a hit has is asked of a hit object that encodes none (SPV_EXT_shader_invocation_reorder)"
            }
            Self::NullAnyHit => {
                "an any-hit shader is null, and the pipeline has NO_NULL_ANY_HIT_SHADERS \
                 (VUID-vkCmdTraceRaysKHR-flags-03512)"
            }
            Self::NullClosestHit => {
                "a closest-hit shader is null, and the pipeline has NO_NULL_CLOSEST_HIT_SHADERS \
                 (VUID-vkCmdTraceRaysKHR-flags-03513)"
            }
            Self::NullMiss => {
                "a miss shader is null, and the pipeline has NO_NULL_MISS_SHADERS \
                 (VUID-vkCmdTraceRaysKHR-flags-03511)"
            }
            Self::NullIntersection => {
                "an intersection shader is null, and the pipeline has NO_NULL_INTERSECTION_SHADERS \
                 (VUID-vkCmdTraceRaysKHR-flags-03514)"
            }
            Self::Callee => "a called shader trapped",
        }
    }

    /// The limits of running.
    const LIMITS: [Self; 4] =
        [Self::OutOfFuel, Self::LaunchOutOfFuel, Self::LaunchTimedOut, Self::BatchTimedOut];

    /// The limit of running that a message tells of; see [`TrapCode::is_limit`].
    pub fn limit_of_message(message: &str) -> Option<Self> {
        Self::LIMITS.into_iter().find(|code| message.ends_with(code.message()))
    }

    /// Whether the clock stopped the invocation: where it was then depends on the machine.
    pub fn is_of_clock(self) -> bool {
        matches!(self, Self::LaunchTimedOut | Self::BatchTimedOut)
    }

    /// Whether a limit of running stopped the invocation: what others have left behind then depends
    /// on how many of them run side by side.
    pub fn is_limit(self) -> bool {
        Self::LIMITS.contains(&self)
    }
}

impl fmt::Display for TrapCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.message())
    }
}

/// The details of an access that trapped, for its report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AccessFault {
    /// A descriptor that is not bound, or of another kind.
    Descriptor {
        /// Slot and array element; see [`Bindings::handle`](crate::machine::Bindings::handle).
        handle: u32,
        /// What is bound.
        bound: Arc<[BindingSummary]>,
    },
    /// A device address without a buffer, or beyond the end of its buffer.
    Address {
        /// Where the nearest buffer begins.
        start: u64,
        /// The size of that buffer.
        size: u64,
        /// Slot and array element, where a descriptor leads to it, too.
        handle: Option<u32>,
        /// The scene's name for it.
        name: Option<Arc<str>>,
    },
    /// Bytes of a buffer.
    Buffer {
        /// Slot and array element, where a descriptor leads to it.
        handle: Option<u32>,
        /// The size of the buffer, or of the range that is bound.
        size: u64,
        /// Of a range: the buffer's name, and the offset in it.
        view: Option<(Arc<str>, u64)>,
    },
    /// A texel of an image.
    Texel {
        /// Slot and array element.
        handle: u32,
        /// Column, row and slice, then the layer of an array or cube.
        coordinate: Vec<i64>,
        /// Columns, rows and slices of the level, then the layers.
        extent: Vec<u32>,
        /// The level, and how many the image has.
        level: [u32; 2],
        /// The sample, and how many a texel has.
        sample: [u32; 2],
    },
}

impl AccessFault {
    /// A descriptor that was not found.
    pub fn descriptor(handle: u32, bindings: &Bindings) -> Self {
        Self::Descriptor { handle, bound: bindings.bound.clone() }
    }

    /// The value of an acceleration structure that was not found; `None` for a device address.
    pub fn structure(value: u64, bindings: &Bindings) -> Option<Self> {
        ((value >> 32) as u32 == STRUCTURE_HANDLE).then(|| Self::descriptor(value as u32, bindings))
    }

    /// A device address; `None` where no buffer has one.
    pub fn address(address: u64, bindings: &Bindings) -> Option<Self> {
        let (start, buffer, name) = bindings.memory.nearest_buffer(address)?;
        let handle = bindings.handle_of(buffer);
        Some(Self::Address { start, size: buffer.size(), handle, name: name.cloned() })
    }
}

/// A trap with the place in the program where it happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trap {
    /// The kind of the trap.
    pub code: TrapCode,
    /// The index of the operation in its program.
    pub op: u32,
}

/// How one lane of a batch ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Exit {
    /// It is still running, or ran to the end of its entry point.
    #[default]
    Returned,
    /// `OpIgnoreIntersectionKHR`
    Ignored,
    /// `OpTerminateRayKHR`
    Terminated,
    /// The machine stopped it.
    Trapped(Trap),
}
