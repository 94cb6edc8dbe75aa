//! Ray query instructions (`SPV_KHR_ray_query`, and the ray query parts of
//! `SPV_KHR_ray_tracing_position_fetch` and `SPV_NV_linear_swept_spheres`).
//!
//! Candidates come in the declared order (see [`Cursor`](crate::accel::Cursor)), opaque ones are
//! committed without becoming candidates of the shader. Spheres and linear swept spheres count as
//! triangles in `OpRayQueryGetIntersectionTypeKHR`; their barycentrics, which no specification
//! defines, are (u, 0), u being 0 for a sphere, and they are never front facing.

use crate::module::Opcode;
use smallvec::SmallVec;

use crate::accel::{RayFlags, TraceRay};
use crate::geometry::{ObjectRay, Ray};
use crate::machine::object::ObjectRef;
use crate::machine::{AccessFault, Batch, Bindings, Mask, RayQuery, Reg, TrapCode};
use crate::math::array;
use crate::ops::access::{Access, object_accesses, object_write_accesses};
use crate::ops::builtin::{ValueShape, floats};
use crate::ops::intersection_view::{IntersectionView, write_floats, write_word};
use crate::ops::memory;
use anyhit_base::error::Result;

pub use translate::translate;

mod translate;

/// Words of the operands of `OpRayQueryInitializeKHR`: acceleration structure (2), ray flags, cull
/// mask, origin (3), t min, direction (3), t max.
const OPERANDS: u32 = 12;

/// `OpRayQueryGetIntersectionTypeKHR` of a candidate.
const CANDIDATE_TRIANGLE: u32 = 0;
const CANDIDATE_AABB: u32 = 1;
/// `OpRayQueryGetIntersectionTypeKHR` of the committed intersection.
const COMMITTED_NONE: u32 = 0;
const COMMITTED_TRIANGLE: u32 = 1;
const COMMITTED_GENERATED: u32 = 2;

/// What a shader's execution mode `OpacityMicromapIdKHR` says of its ray queries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MicromapMode {
    /// The shader does not have it. `SPV_KHR_opacity_micromap` leaves a query over opacity
    /// micromaps undefined; here it reads them, as with `VK_EXT_opacity_micromap`.
    Undeclared,
    /// It is true: queries read opacity micromaps.
    Enabled,
    /// It is false: a query over opacity micromaps traps.
    Disabled,
}

/// An operation on ray queries.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "a variant's line tells its fields")]
pub enum RayQueryOp {
    /// `OpRayQueryInitializeKHR`; the operands lie in consecutive registers.
    Initialize { query: ObjectRef, operands: Reg, micromaps: MicromapMode },
    /// `OpRayQueryProceedKHR`
    Proceed { query: ObjectRef, to: Reg },
    /// `OpRayQueryTerminateKHR`
    Terminate { query: ObjectRef },
    /// `OpRayQueryConfirmIntersectionKHR`
    Confirm { query: ObjectRef },
    /// `OpRayQueryGenerateIntersectionKHR`
    Generate { query: ObjectRef, t: Reg },
    /// `OpRayQueryGetIntersectionTypeKHR`
    Type { query: ObjectRef, committed: bool, to: Reg },
    /// An instruction that reads the ray.
    GetRay { query: ObjectRef, getter: &'static RayGetter, to: Reg },
    /// An instruction that reads the candidate or the committed hit.
    Get { query: ObjectRef, committed: bool, getter: &'static RayQueryGetter, to: Reg },
    /// Makes the `count` queries that a variable holds uninitialized, as the variable is declared
    /// again.
    Uninitialize { first: Reg, count: u32 },
}

/// An instruction that reads the ray.
pub struct RayGetter {
    opcode: Opcode,
    shape: ValueShape,
    read: fn(&TraceRay, &mut [u32]),
}

/// An instruction that reads the candidate or the committed hit.
pub struct RayQueryGetter {
    opcode: Opcode,
    shape: ValueShape,
    read: fn(IntersectionView<'_>, &mut [u32]) -> Result<(), TrapCode>,
}

impl RayGetter {
    /// Words that it reads.
    pub fn words(&self) -> u32 {
        self.shape.words()
    }

    /// The first word, among the operands of `OpRayQueryInitializeKHR`, of what it reads.
    pub fn operand(&self) -> Option<u32> {
        match self.opcode {
            Opcode::RayQueryGetRayFlagsKHR => Some(2),
            Opcode::RayQueryGetWorldRayOriginKHR => Some(4),
            Opcode::RayQueryGetRayTMinKHR => Some(7),
            Opcode::RayQueryGetWorldRayDirectionKHR => Some(8),
            _ => None,
        }
    }
}

impl RayQueryGetter {
    /// Whether it reads the t of a hit.
    pub fn reads_t(&self) -> bool {
        self.opcode == Opcode::RayQueryGetIntersectionTKHR
    }

    /// Whether it reads the ray in the object space of an instance, or a transform of that.
    pub fn reads_object_space(&self) -> bool {
        matches!(
            self.opcode,
            Opcode::RayQueryGetIntersectionObjectRayDirectionKHR
                | Opcode::RayQueryGetIntersectionObjectRayOriginKHR
                | Opcode::RayQueryGetIntersectionObjectToWorldKHR
                | Opcode::RayQueryGetIntersectionWorldToObjectKHR
        )
    }
}

macro_rules! impl_by_opcode {
    ($($ty:ty)*) => {$(
        impl std::fmt::Debug for $ty {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "{:?}", self.opcode)
            }
        }

        impl PartialEq for $ty {
            fn eq(&self, other: &Self) -> bool {
                self.opcode == other.opcode
            }
        }
    )*};
}

impl_by_opcode!(RayGetter RayQueryGetter);

macro_rules! getters {
    ($table:ident $ty:ident $($name:ident $shape:ident |$from:ident, $to:ident| $read:expr;)*) => {
        static $table: &[$ty] =
            &[$($ty { opcode: Opcode::$name, shape: ValueShape::$shape, read: |$from, $to| $read }),*];
    };
}

getters! { RAY_GETTERS RayGetter
    RayQueryGetRayTMinKHR Float |from, to| floats(to, &[from.ray.t_min]);
    RayQueryGetRayFlagsKHR Int |from, to| to[0] = from.flags.0;
    RayQueryGetWorldRayOriginKHR Float3 |from, to| floats(to, &from.ray.origin);
    RayQueryGetWorldRayDirectionKHR Float3 |from, to| floats(to, &from.ray.direction);
}

getters! { GETTERS RayQueryGetter
    RayQueryGetIntersectionTKHR Float |from, to| from.t(to);
    RayQueryGetIntersectionInstanceCustomIndexKHR Int |from, to| from.custom_index(to);
    RayQueryGetIntersectionInstanceIdKHR Int |from, to| write_word(to, from.candidate.instance);
    RayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR Int |from, to| from.sbt_record_offset(to);
    RayQueryGetIntersectionGeometryIndexKHR Int |from, to| write_word(to, from.candidate.geometry);
    RayQueryGetIntersectionPrimitiveIndexKHR Int |from, to| write_word(to, from.candidate.primitive);
    RayQueryGetIntersectionBarycentricsKHR Float2 |from, to| from.barycentrics(to);
    RayQueryGetIntersectionFrontFaceKHR Bool |from, to| from.front_face(to);
    RayQueryGetIntersectionObjectRayDirectionKHR Float3
        |from, to| from.object_ray(to, ObjectRay::object_direction_f32);
    RayQueryGetIntersectionObjectRayOriginKHR Float3
        |from, to| from.object_ray(to, ObjectRay::object_origin_f32);
    RayQueryGetIntersectionObjectToWorldKHR Matrix4x3 |from, to| from.object_to_world(to);
    RayQueryGetIntersectionWorldToObjectKHR Matrix4x3 |from, to| from.world_to_object(to);
    RayQueryGetIntersectionTriangleVertexPositionsKHR Float3Array3 |from, to| from.vertex_positions(to);
    RayQueryGetIntersectionClusterIdNV Int |from, to| write_word(to, from.candidate.cluster_id(from.tlas));
    RayQueryIsSphereHitNV Bool |from, to| write_word(to, from.is_sphere().into());
    RayQueryIsLSSHitNV Bool |from, to| write_word(to, from.is_lss().into());
    RayQueryGetIntersectionSpherePositionNV Float3 |from, to| write_floats(to, &from.sphere()?.0);
    RayQueryGetIntersectionSphereRadiusNV Float |from, to| write_floats(to, &[from.sphere()?.1]);
    RayQueryGetIntersectionLSSPositionsNV Float3Array2 |from, to| write_floats(to, from.lss()?.0.as_flattened());
    RayQueryGetIntersectionLSSRadiiNV FloatArray2 |from, to| write_floats(to, &from.lss()?.1);
    RayQueryGetIntersectionLSSHitValueNV Float
        |from, to| from.lss().and_then(|_| write_floats(to, &from.candidate.intersection.attributes[..1]));
}

/// `OpRayQueryGetIntersectionCandidateAABBOpaqueKHR`, which reads the candidate alone.
static AABB_OPAQUE: RayQueryGetter = RayQueryGetter {
    opcode: Opcode::RayQueryGetIntersectionCandidateAABBOpaqueKHR,
    shape: ValueShape::Bool,
    read: |from, to| match from.candidate.is_box() {
        true => write_word(to, from.candidate.opaque.into()),
        false => Err(TrapCode::RayQueryNotAabb),
    },
};

impl RayQueryOp {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        match *self {
            Self::Initialize { query, operands, .. } => {
                object_write_accesses(query, visit);
                visit(Access::Read(operands, OPERANDS));
            }
            Self::Proceed { query, to } => {
                object_accesses(query, visit);
                visit(Access::Write(to, 1));
                visit(Access::Effect);
            }
            Self::Terminate { query } | Self::Confirm { query } => {
                object_accesses(query, visit);
                visit(Access::Effect);
            }
            Self::Generate { query, t } => {
                object_accesses(query, visit);
                visit(Access::Read(t, 1));
                visit(Access::Effect);
            }
            Self::Type { query, to, .. } => {
                object_accesses(query, visit);
                visit(Access::Write(to, 1));
            }
            Self::GetRay { query, getter, to } => {
                object_accesses(query, visit);
                visit(Access::Write(to, getter.shape.words()));
            }
            Self::Get { query, getter, to, .. } => {
                object_accesses(query, visit);
                visit(Access::Write(to, getter.shape.words()));
            }
            Self::Uninitialize { first, count } => {
                visit(Access::Read(first, count));
                visit(Access::Effect);
            }
        }
    }

    /// Where the handle of its query lies.
    pub fn query(&self) -> Option<ObjectRef> {
        match *self {
            Self::Initialize { query, .. }
            | Self::Proceed { query, .. }
            | Self::Terminate { query }
            | Self::Confirm { query }
            | Self::Generate { query, .. }
            | Self::Type { query, .. }
            | Self::GetRay { query, .. }
            | Self::Get { query, .. } => Some(query),
            Self::Uninitialize { .. } => None,
        }
    }

    /// Runs the operation for the running lanes.
    #[inline(never)]
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        match *self {
            Self::Initialize { query, operands, micromaps } => {
                initialize(batch, bindings, query, operands, micromaps);
            }
            Self::Proceed { query, to } => {
                look_ahead(batch, query);
                for_each_lane(batch, query, |batch, handle, lane| {
                    batch.registers[to].0[lane] = u32::from(batch.queries.proceed(handle, batch.op)?);
                    Ok(())
                });
            }
            Self::Terminate { query } => {
                for_each_lane(batch, query, |batch, handle, _| batch.queries.terminate(handle, batch.op));
            }
            Self::Confirm { query } => {
                for_each_lane(batch, query, |batch, handle, _| batch.queries.confirm(handle, batch.op));
            }
            Self::Generate { query, t } => for_each_lane(batch, query, |batch, handle, lane| {
                let t = f32::from_bits(batch.registers[t].0[lane]);
                batch.queries.generate(handle, batch.op, t)
            }),
            Self::Type { query, committed, to } => for_each_lane(batch, query, |batch, handle, lane| {
                let query = batch.queries.query(handle)?;
                batch.registers[to].0[lane] = intersection_type(query, committed)?;
                Ok(())
            }),
            Self::GetRay { query, getter, to } => for_each_lane(batch, query, |batch, handle, lane| {
                let query = batch.queries.query(handle)?;
                let mut words = [0; 3];
                let words = &mut words[..getter.shape.words() as usize];
                (getter.read)(query.trace(), words);
                for (at, &word) in words.iter().enumerate() {
                    batch.registers[to.plus(at as u32)].0[lane] = word;
                }
                Ok(())
            }),
            Self::Get { query, committed, getter, to } => {
                for_each_lane(batch, query, |batch, handle, lane| {
                    let query = batch.queries.query(handle)?;
                    let mut words = [0; 12];
                    let words = &mut words[..getter.shape.words() as usize];
                    (getter.read)(intersection_view(query, committed)?, words)?;
                    for (at, &word) in words.iter().enumerate() {
                        batch.registers[to.plus(at as u32)].0[lane] = word;
                    }
                    Ok(())
                })
            }
            Self::Uninitialize { first, count } => {
                for lane in batch.mask.lanes() {
                    for register in 0..count {
                        batch.queries.uninitialize(batch.registers[first.plus(register)].0[lane]);
                    }
                }
            }
        }
    }
}

/// Calls a function for each running lane with the handle of its query; lanes that it fails for are
/// stopped.
#[inline(always)]
fn for_each_lane<const W: usize>(
    batch: &mut Batch<W>,
    query: ObjectRef,
    mut access: impl FnMut(&mut Batch<W>, u32, usize) -> Result<(), TrapCode>,
) {
    for lane in batch.mask.lanes() {
        let register = query.register(&batch.registers, lane);
        let done = register.and_then(|register| access(batch, batch.registers[register].0[lane], lane));
        if let Err(code) = done {
            memory::trap(batch, Mask::lane(lane), code);
        }
    }
}

/// Finds together what the queries of the running lanes come to next.
fn look_ahead<const W: usize>(batch: &mut Batch<W>, query: ObjectRef) {
    if batch.mask.count() <= 1 {
        return;
    }
    let mut handles = SmallVec::<[u32; 64]>::new();
    for lane in batch.mask.lanes() {
        if let Ok(register) = query.register(&batch.registers, lane) {
            handles.push(batch.registers[register].0[lane]);
        }
    }
    batch.queries.look_ahead(&handles);
}

fn initialize<const W: usize>(
    batch: &mut Batch<W>,
    bindings: &Bindings,
    query: ObjectRef,
    operands: Reg,
    micromaps: MicromapMode,
) {
    // Mostly all lanes name one structure.
    let mut known = (0, bindings.acceleration_structure([0; 2]));
    for lane in batch.mask.lanes() {
        let words: [u32; OPERANDS as usize] = batch.registers.lane_array(operands, lane);
        let structure = u64::from(words[0]) | u64::from(words[1]) << 32;
        if structure != known.0 {
            known = (structure, bindings.acceleration_structure([words[0], words[1]]));
        }
        let mut fault_value = structure;
        let done = query.register(&batch.registers, lane).and_then(|register| {
            let tlas = known.1.ok_or(TrapCode::AccelerationStructureMissing)?;
            if micromaps == MicromapMode::Disabled && tlas.has_micromaps() {
                return Err(TrapCode::RayQueryMicromaps);
            }
            let [t_min, t_max] = array::map([words[7], words[11]], f32::from_bits);
            let float3 = |at: usize| array::map([0, 1, 2], |axis| f32::from_bits(words[at + axis]));
            let ray = Ray { origin: float3(4), t_min, direction: float3(8), t_max };
            let trace = TraceRay { ray, flags: RayFlags(words[2]), cull_mask: words[3], time: 0.0 };
            if let Err(broken) = trace.check() {
                fault_value = broken as u64;
                return Err(TrapCode::InvalidRayQuery);
            }
            let handle = batch.registers[register].0[lane];
            let handle = batch.queries.initialize(handle, lane as u32, batch.op, tlas, trace);
            batch.registers[register].0[lane] = handle;
            if let Some(choices) = &bindings.choices {
                batch.queries.draw(handle, batch.op, choices, batch.invocations.launch_id(lane));
            }
            Ok(())
        });
        if let Err(code) = done {
            batch.fault_value[lane] = fault_value;
            if code == TrapCode::AccelerationStructureMissing {
                let fault = AccessFault::structure(fault_value, bindings);
                fault.into_iter().for_each(|fault| batch.record_access_fault(lane, fault));
            }
            memory::trap(batch, Mask::lane(lane), code);
        }
    }
}

fn intersection_type(query: &RayQuery, committed: bool) -> Result<u32, TrapCode> {
    Ok(match (committed, query.committed()) {
        (true, None) => COMMITTED_NONE,
        (true, Some(committed)) if committed.candidate.is_box() => COMMITTED_GENERATED,
        (true, Some(_)) => COMMITTED_TRIANGLE,
        (false, _) if query.candidate()?.is_box() => CANDIDATE_AABB,
        (false, _) => CANDIDATE_TRIANGLE,
    })
}

fn intersection_view(query: &RayQuery, committed: bool) -> Result<IntersectionView<'_>, TrapCode> {
    let (candidate, t) = if committed {
        let committed = query.committed().ok_or(TrapCode::RayQueryNoCommitted)?;
        (&committed.candidate, committed.t)
    } else {
        let candidate = query.candidate()?;
        (candidate, candidate.intersection.t)
    };
    Ok(IntersectionView { tlas: query.tlas(), trace: query.trace(), candidate, t, committed })
}

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::RayQueryInitializeKHR,
    Opcode::RayQueryTerminateKHR,
    Opcode::RayQueryGenerateIntersectionKHR,
    Opcode::RayQueryConfirmIntersectionKHR,
    Opcode::RayQueryProceedKHR,
    Opcode::RayQueryGetIntersectionTypeKHR,
    Opcode::RayQueryGetIntersectionCandidateAABBOpaqueKHR,
    Opcode::RayQueryGetRayTMinKHR,
    Opcode::RayQueryGetRayFlagsKHR,
    Opcode::RayQueryGetWorldRayOriginKHR,
    Opcode::RayQueryGetWorldRayDirectionKHR,
    Opcode::RayQueryGetIntersectionTKHR,
    Opcode::RayQueryGetIntersectionInstanceCustomIndexKHR,
    Opcode::RayQueryGetIntersectionInstanceIdKHR,
    Opcode::RayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetKHR,
    Opcode::RayQueryGetIntersectionGeometryIndexKHR,
    Opcode::RayQueryGetIntersectionPrimitiveIndexKHR,
    Opcode::RayQueryGetIntersectionBarycentricsKHR,
    Opcode::RayQueryGetIntersectionFrontFaceKHR,
    Opcode::RayQueryGetIntersectionObjectRayDirectionKHR,
    Opcode::RayQueryGetIntersectionObjectRayOriginKHR,
    Opcode::RayQueryGetIntersectionObjectToWorldKHR,
    Opcode::RayQueryGetIntersectionWorldToObjectKHR,
    Opcode::RayQueryGetIntersectionTriangleVertexPositionsKHR,
    Opcode::RayQueryGetIntersectionClusterIdNV,
    Opcode::RayQueryIsSphereHitNV,
    Opcode::RayQueryIsLSSHitNV,
    Opcode::RayQueryGetIntersectionSpherePositionNV,
    Opcode::RayQueryGetIntersectionSphereRadiusNV,
    Opcode::RayQueryGetIntersectionLSSPositionsNV,
    Opcode::RayQueryGetIntersectionLSSRadiiNV,
    Opcode::RayQueryGetIntersectionLSSHitValueNV,
];
