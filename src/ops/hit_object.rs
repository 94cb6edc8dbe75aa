//! Hit object instructions (`SPV_EXT_shader_invocation_reorder`, `SPV_NV_shader_invocation_reorder`,
//! and the hit object parts of `SPV_NV_linear_swept_spheres`).
//!
//! Reordering changes no result: it is counted. Tracing, executing and the address of a shader
//! record are the pipeline's business, see [`crate::ops::ray_tracing::Op`].

use rspirv::spirv::Op as Opcode;
use smallvec::SmallVec;

use crate::accel::{Candidate, Committed, GeometryKind, HitKind, RayFlags, TraceRay, hit_record_index};
use crate::error::Result;
use crate::geometry::{Intersection, ObjectRay, Ray, Surface};
use crate::machine::hit_object::{Attributes, Encoded, HitEncoded, HitObject};
use crate::machine::object::ObjectRef;
use crate::machine::stop::Rows;
use crate::machine::{Batch, Bindings, Mask, Reg, Registers, TrapCode};
use crate::module::Instruction;
use crate::module::interface::Stage;
use crate::module::ty::Type;
use crate::ops::builtin::Shape;
use crate::ops::decode::Decoder;
use crate::ops::memory;
use crate::ops::object::{self, object, result};
use crate::ops::op::{Access, Op as Operation};
use crate::ops::pointer::storage;
use crate::ops::ray_tracing::{self, TRACE_OPERANDS, variable_rows};
use crate::ops::seen::{Seen, put, word};

/// Words of the operands of the instructions that record a miss: ray flags, miss index, origin (3),
/// t min, direction (3), t max.
const MISS_OPERANDS: u32 = 10;

/// An operation on hit objects.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "a variant's line tells its fields")]
pub enum Op {
    /// `OpHitObjectRecordHitNV` and `OpHitObjectRecordHitWithIndexNV`. The operands: acceleration
    /// structure (2), instance, primitive, geometry, hit kind, then SBT offset and stride or the
    /// record's index, origin (3), t min, direction (3), t max.
    RecordHit { object: ObjectRef, operands: Reg, with_index: bool, attributes: Rows },
    /// `OpHitObjectRecordMissEXT`, `OpHitObjectRecordMissNV`
    RecordMiss { object: ObjectRef, operands: Reg },
    /// `OpHitObjectRecordEmptyEXT`
    RecordEmpty { object: ObjectRef },
    /// `OpHitObjectRecordFromQueryEXT`
    RecordFromQuery {
        object: ObjectRef,
        query: ObjectRef,
        record: Reg,
        attributes: Rows,
        hit_kind: Option<Reg>,
    },
    /// `OpHitObjectSetShaderBindingTableRecordIndexEXT`
    SetRecord { object: ObjectRef, record: Reg },
    /// An instruction that reads.
    Get { object: ObjectRef, getter: &'static Getter, to: Reg },
    /// `OpHitObjectGetAttributesEXT`
    GetAttributes { object: ObjectRef, to: Rows },
    /// `OpReorderThreadWithHintEXT`, `OpReorderThreadWithHitObjectEXT`
    Reorder,
}

/// An instruction that reads a hit object.
pub struct Getter {
    name: &'static str,
    opcodes: &'static [Opcode],
    shape: Shape,
    read: fn(&HitObject, &mut [u32]) -> Result<(), TrapCode>,
}

impl std::fmt::Debug for Getter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Getter {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

macro_rules! getters {
    ($($name:ident [$($opcode:ident)*] $shape:ident |$from:ident, $to:ident| $read:expr;)*) => {
        static GETTERS: &[Getter] = &[$(Getter {
            name: stringify!($name),
            opcodes: &[$(Opcode::$opcode),*],
            shape: Shape::$shape,
            read: |$from, $to| $read,
        }),*];
    };
}

getters! {
    IsEmpty [HitObjectIsEmptyEXT HitObjectIsEmptyNV] Bool |from, to| word(to, from.state()?[0].into());
    IsMiss [HitObjectIsMissEXT HitObjectIsMissNV] Bool |from, to| word(to, from.state()?[1].into());
    IsHit [HitObjectIsHitEXT HitObjectIsHitNV] Bool |from, to| word(to, from.state()?[2].into());
    GetRayTMin [HitObjectGetRayTMinEXT HitObjectGetRayTMinNV] Float
        |from, to| put(to, &[from.encoded()?.trace.ray.t_min]);
    GetRayTMax [HitObjectGetRayTMaxEXT HitObjectGetRayTMaxNV] Float |from, to| put(to, &[from.t_max()?]);
    GetRayFlags [HitObjectGetRayFlagsEXT] Int |from, to| word(to, from.encoded()?.trace.flags.0);
    GetWorldRayOrigin [HitObjectGetWorldRayOriginEXT HitObjectGetWorldRayOriginNV] Float3
        |from, to| put(to, &from.encoded()?.trace.ray.origin);
    GetWorldRayDirection [HitObjectGetWorldRayDirectionEXT HitObjectGetWorldRayDirectionNV] Float3
        |from, to| put(to, &from.encoded()?.trace.ray.direction);
    // No trace here has a time but 0.
    GetCurrentTime [HitObjectGetCurrentTimeEXT HitObjectGetCurrentTimeNV] Float
        |from, to| from.encoded().and_then(|_| put(to, &[0.0]));
    GetShaderBindingTableRecordIndex
        [HitObjectGetShaderBindingTableRecordIndexEXT HitObjectGetShaderBindingTableRecordIndexNV] Int
        |from, to| word(to, from.encoded()?.record as u32);
    GetInstanceCustomIndex [HitObjectGetInstanceCustomIndexEXT HitObjectGetInstanceCustomIndexNV] Int
        |from, to| seen(from)?.custom_index(to);
    GetInstanceId [HitObjectGetInstanceIdEXT HitObjectGetInstanceIdNV] Int
        |from, to| word(to, seen(from)?.candidate.instance);
    GetGeometryIndex [HitObjectGetGeometryIndexEXT HitObjectGetGeometryIndexNV] Int
        |from, to| word(to, seen(from)?.candidate.geometry);
    GetPrimitiveIndex [HitObjectGetPrimitiveIndexEXT HitObjectGetPrimitiveIndexNV] Int
        |from, to| word(to, seen(from)?.candidate.primitive);
    GetHitKind [HitObjectGetHitKindEXT HitObjectGetHitKindNV] Int
        |from, to| word(to, from.hit()?.1.committed.hit_kind.0);
    GetObjectRayOrigin [HitObjectGetObjectRayOriginEXT HitObjectGetObjectRayOriginNV] Float3
        |from, to| seen(from)?.object_ray(to, ObjectRay::object_origin_f32);
    GetObjectRayDirection [HitObjectGetObjectRayDirectionEXT HitObjectGetObjectRayDirectionNV] Float3
        |from, to| seen(from)?.object_ray(to, ObjectRay::object_direction_f32);
    GetObjectToWorld [HitObjectGetObjectToWorldEXT HitObjectGetObjectToWorldNV] Matrix4x3
        |from, to| seen(from)?.object_to_world(to);
    GetWorldToObject [HitObjectGetWorldToObjectEXT HitObjectGetWorldToObjectNV] Matrix4x3
        |from, to| seen(from)?.world_to_object(to);
    GetIntersectionTriangleVertexPositions [HitObjectGetIntersectionTriangleVertexPositionsEXT] Float3Array3
        |from, to| seen(from)?.vertex_positions(to);
    GetClusterId [HitObjectGetClusterIdNV] Int
        |from, to| from.hit().and_then(|(_, hit)| word(to, hit.committed.candidate.cluster_id(&hit.tlas)));
    IsSphereHit [HitObjectIsSphereHitNV] Bool |from, to| word(to, seen_or_none(from)?.is_some_and(Seen::is_sphere).into());
    IsLSSHit [HitObjectIsLSSHitNV] Bool |from, to| word(to, seen_or_none(from)?.is_some_and(Seen::is_lss).into());
    GetSpherePosition [HitObjectGetSpherePositionNV] Float3 |from, to| put(to, &seen(from)?.sphere()?.0);
    GetSphereRadius [HitObjectGetSphereRadiusNV] Float |from, to| put(to, &[seen(from)?.sphere()?.1]);
    GetLSSPositions [HitObjectGetLSSPositionsNV] Float3Array2 |from, to| put(to, seen(from)?.lss()?.0.as_flattened());
    GetLSSRadii [HitObjectGetLSSRadiiNV] FloatArray2 |from, to| put(to, &seen(from)?.lss()?.1);
}

fn seen(object: &HitObject) -> Result<Seen<'_>, TrapCode> {
    let (encoded, hit) = object.hit()?;
    let Committed { candidate, t, .. } = &hit.committed;
    Ok(Seen { tlas: &hit.tlas, ray: &encoded.trace.ray, candidate, t: *t, committed: true })
}

/// For the questions that a miss answers with no.
fn seen_or_none(object: &HitObject) -> Result<Option<Seen<'_>>, TrapCode> {
    object.state()?;
    Ok(seen(object).ok())
}

impl Op {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut impl FnMut(Access)) {
        match *self {
            Self::RecordHit { object, operands, with_index, attributes } => {
                object::records(object, visit);
                visit(Access::Read(operands, hit_operands(with_index)));
                visit(Access::Read(attributes.first, attributes.count));
            }
            Self::RecordMiss { object, operands } => {
                object::records(object, visit);
                visit(Access::Read(operands, MISS_OPERANDS));
            }
            Self::RecordEmpty { object } => object::records(object, visit),
            Self::RecordFromQuery { object, query, record, attributes, hit_kind } => {
                object::records(object, visit);
                object::accesses(query, visit);
                visit(Access::Read(record, 1));
                visit(Access::Read(attributes.first, attributes.count));
                if let Some(hit_kind) = hit_kind {
                    visit(Access::Read(hit_kind, 1));
                }
            }
            Self::SetRecord { object, record } => {
                object::accesses(object, visit);
                visit(Access::Read(record, 1));
                visit(Access::Effect);
            }
            Self::Get { object, getter, to } => {
                object::accesses(object, visit);
                visit(Access::Write(to, getter.shape.words()));
            }
            Self::GetAttributes { object, to } => {
                object::accesses(object, visit);
                visit(Access::Write(to.first, to.count));
            }
            Self::Reorder => visit(Access::Effect),
        }
    }

    /// Runs the operation for the running lanes.
    #[inline(never)]
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        match *self {
            Self::RecordHit { object, operands, with_index, attributes } => {
                each(batch, |batch, lane| {
                    let words = words(batch, operands, hit_operands(with_index), lane);
                    let attributes =
                        batch.registers.lane_words(attributes.first, attributes.count, lane).collect();
                    let hit = hit(bindings, &words, with_index, attributes)?;
                    store(batch, object, lane, hit)
                });
            }
            Self::RecordMiss { object, operands } => each(batch, |batch, lane| {
                let words = words(batch, operands, MISS_OPERANDS, lane);
                let trace = TraceRay { ray: ray(&words[2..]), flags: RayFlags(words[0]), cull_mask: 0xFF };
                legal(&trace)?;
                let record = u64::from(words[1] & 0xFFFF);
                store(batch, object, lane, HitObject::Miss(Encoded { trace, record }))
            }),
            Self::RecordEmpty { object } => {
                each(batch, |batch, lane| store(batch, object, lane, HitObject::Empty));
            }
            Self::RecordFromQuery { object, query, record, attributes, hit_kind } => {
                each(batch, |batch, lane| {
                    let record = u64::from(batch.registers[record].0[lane]);
                    let given: Attributes =
                        batch.registers.lane_words(attributes.first, attributes.count, lane).collect();
                    let kind = hit_kind.map_or(0, |reg| batch.registers[reg].0[lane]);
                    let row = query.row(&batch.registers, lane)?;
                    let query = batch.queries.query(batch.registers[row].0[lane])?;
                    let Some(&committed) = query.committed() else {
                        return store(batch, object, lane, HitObject::Empty);
                    };
                    let encoded = Encoded { trace: *query.trace(), record };
                    let tlas = query.tlas().clone();
                    let (committed, attributes) = match committed.candidate.is_box() {
                        true => (Committed { hit_kind: HitKind(kind), ..committed }, given),
                        false => (committed, built_in_attributes(&committed.candidate)),
                    };
                    let hit = HitEncoded { tlas, committed, attributes };
                    store(batch, object, lane, HitObject::Hit(encoded, hit))
                });
            }
            Self::SetRecord { object, record } => each(batch, |batch, lane| {
                let record = batch.registers[record].0[lane];
                find(batch, object, lane)?.1.set_record(record)
            }),
            Self::Get { object, getter, to } => each(batch, |batch, lane| {
                let (registers, object) = find(batch, object, lane)?;
                let mut words = [0; 12];
                let words = &mut words[..getter.shape.words() as usize];
                (getter.read)(object, words)?;
                registers.set_lane_words(to, lane, words.iter().copied());
                Ok(())
            }),
            Self::GetAttributes { object, to } => each(batch, |batch, lane| {
                let (registers, object) = find(batch, object, lane)?;
                let attributes = object.hit()?.1.attributes.iter().copied().chain(std::iter::repeat(0));
                registers.set_lane_words(to.first, lane, attributes.take(to.count as usize));
                Ok(())
            }),
            Self::Reorder => batch.reorders += u64::from(batch.mask.count()),
        }
    }
}

/// Attributes of a triangle, sphere or linear swept sphere, as words.
pub fn built_in_attributes(candidate: &Candidate) -> Attributes {
    candidate.intersection.attributes.iter().map(|attribute| attribute.to_bits()).collect()
}

/// Calls a function for each running lane; lanes that it fails for are stopped.
#[inline(always)]
fn each<const W: usize>(
    batch: &mut Batch<W>,
    mut access: impl FnMut(&mut Batch<W>, usize) -> Result<(), TrapCode>,
) {
    for lane in batch.mask.lanes() {
        if let Err(code) = access(batch, lane) {
            memory::trap(batch, Mask::lane(lane), code);
        }
    }
}

/// The hit object of a lane.
fn find<const W: usize>(
    batch: &mut Batch<W>,
    object: ObjectRef,
    lane: usize,
) -> Result<(&mut Registers<W>, &mut HitObject), TrapCode> {
    let row = object.row(&batch.registers, lane)?;
    let found = batch.hit_objects.get_mut(batch.registers[row].0[lane]);
    Ok((&mut batch.registers, found.ok_or(TrapCode::HitObjectUnrecorded)?))
}

/// Records what a lane's hit object is from now on.
///
/// # Errors
/// `IndexOutOfBounds` where the object's variable is an array and its index outside.
pub fn store<const W: usize>(
    batch: &mut Batch<W>,
    object: ObjectRef,
    lane: usize,
    recorded: HitObject,
) -> Result<(), TrapCode> {
    let row = object.row(&batch.registers, lane)?;
    let (handle, place) = batch.hit_objects.claim(batch.registers[row].0[lane]);
    *place = recorded;
    batch.registers[row].0[lane] = handle;
    Ok(())
}

fn words<const W: usize>(batch: &Batch<W>, first: Reg, count: u32, lane: usize) -> SmallVec<[u32; 16]> {
    batch.registers.lane_words(first, count, lane).collect()
}

/// Origin, t min, direction, t max.
fn ray(words: &[u32]) -> Ray {
    let float = |at: usize| f32::from_bits(words[at]);
    Ray {
        origin: [float(0), float(1), float(2)],
        t_min: float(3),
        direction: [float(4), float(5), float(6)],
        t_max: float(7),
    }
}

fn legal(trace: &TraceRay) -> Result<(), TrapCode> {
    if trace.is_legal() { Ok(()) } else { Err(TrapCode::InvalidHitObject) }
}

fn hit_operands(with_index: bool) -> u32 {
    if with_index { 15 } else { 16 }
}

/// The hit that the operands of `OpHitObjectRecordHitNV` and its kin describe.
fn hit(
    bindings: &Bindings,
    words: &[u32],
    with_index: bool,
    attributes: Attributes,
) -> Result<HitObject, TrapCode> {
    let tlas = bindings.acceleration_structure([words[0], words[1]]);
    let tlas = tlas.ok_or(TrapCode::AccelerationStructureMissing)?;
    let [instance, primitive, geometry, kind] = [words[2], words[3], words[4], words[5]];
    let place = tlas.instances().get(instance as usize);
    let place = place.filter(|place| {
        let data = place.blas.geometries().get(geometry as usize);
        data.is_some_and(|geometry| (primitive as usize) < geometry.data.primitive_count())
    });
    let place = place.ok_or(TrapCode::HitObjectNoPrimitive)?;
    let (record, rest) = match with_index {
        true => (u64::from(words[6]), &words[7..]),
        false => {
            let record = hit_record_index(place.sbt_record_offset, geometry, words[7], words[6]);
            (record, &words[8..])
        }
    };
    let trace = TraceRay { ray: ray(rest), flags: RayFlags(0), cull_mask: 0xFF };
    legal(&trace)?;
    let [a, b] = [0, 1].map(|at| attributes.get(at).map_or(0.0, |&word| f32::from_bits(word)));
    let surface = surface(place.blas.kind(), HitKind(kind));
    let intersection = Intersection { t: trace.ray.t_max, attributes: [a, b], surface };
    let candidate = Candidate { instance, geometry, primitive, intersection, opaque: true };
    let committed = Committed { candidate, t: trace.ray.t_max, hit_kind: HitKind(kind) };
    let hit = HitEncoded { tlas: tlas.clone(), committed, attributes };
    Ok(HitObject::Hit(Encoded { trace, record }, hit))
}

/// The surface that a recorded hit of a kind of geometry stands for.
fn surface(geometry: Option<GeometryKind>, kind: HitKind) -> Surface {
    match geometry {
        Some(GeometryKind::Triangles) if kind == HitKind::FRONT_FACING_TRIANGLE => Surface::TriangleFront,
        Some(GeometryKind::Triangles) => Surface::TriangleBack,
        Some(GeometryKind::Spheres) => Surface::Sphere,
        Some(GeometryKind::LinearSweptSpheres) => Surface::Side,
        Some(GeometryKind::Aabbs) | None => Surface::Aabb,
    }
}

/// Opcodes decoded here, beside those of `GETTERS`.
pub const OPCODES: &[Opcode] = &[
    Opcode::HitObjectTraceRayEXT,
    Opcode::HitObjectTraceRayNV,
    Opcode::HitObjectRecordHitNV,
    Opcode::HitObjectRecordHitWithIndexNV,
    Opcode::HitObjectRecordMissEXT,
    Opcode::HitObjectRecordMissNV,
    Opcode::HitObjectRecordEmptyEXT,
    Opcode::HitObjectRecordEmptyNV,
    Opcode::HitObjectRecordFromQueryEXT,
    Opcode::HitObjectExecuteShaderEXT,
    Opcode::HitObjectExecuteShaderNV,
    Opcode::HitObjectReorderExecuteShaderEXT,
    Opcode::HitObjectTraceReorderExecuteEXT,
    Opcode::HitObjectSetShaderBindingTableRecordIndexEXT,
    Opcode::HitObjectGetShaderRecordBufferHandleEXT,
    Opcode::HitObjectGetShaderRecordBufferHandleNV,
    Opcode::HitObjectGetAttributesEXT,
    Opcode::HitObjectGetAttributesNV,
    Opcode::ReorderThreadWithHintEXT,
    Opcode::ReorderThreadWithHintNV,
    Opcode::ReorderThreadWithHitObjectEXT,
    Opcode::ReorderThreadWithHitObjectNV,
    Opcode::HitObjectIsEmptyEXT,
    Opcode::HitObjectIsEmptyNV,
    Opcode::HitObjectIsMissEXT,
    Opcode::HitObjectIsMissNV,
    Opcode::HitObjectIsHitEXT,
    Opcode::HitObjectIsHitNV,
    Opcode::HitObjectGetRayTMinEXT,
    Opcode::HitObjectGetRayTMinNV,
    Opcode::HitObjectGetRayTMaxEXT,
    Opcode::HitObjectGetRayTMaxNV,
    Opcode::HitObjectGetRayFlagsEXT,
    Opcode::HitObjectGetWorldRayOriginEXT,
    Opcode::HitObjectGetWorldRayOriginNV,
    Opcode::HitObjectGetWorldRayDirectionEXT,
    Opcode::HitObjectGetWorldRayDirectionNV,
    Opcode::HitObjectGetCurrentTimeEXT,
    Opcode::HitObjectGetCurrentTimeNV,
    Opcode::HitObjectGetShaderBindingTableRecordIndexEXT,
    Opcode::HitObjectGetShaderBindingTableRecordIndexNV,
    Opcode::HitObjectGetInstanceCustomIndexEXT,
    Opcode::HitObjectGetInstanceCustomIndexNV,
    Opcode::HitObjectGetInstanceIdEXT,
    Opcode::HitObjectGetInstanceIdNV,
    Opcode::HitObjectGetGeometryIndexEXT,
    Opcode::HitObjectGetGeometryIndexNV,
    Opcode::HitObjectGetPrimitiveIndexEXT,
    Opcode::HitObjectGetPrimitiveIndexNV,
    Opcode::HitObjectGetHitKindEXT,
    Opcode::HitObjectGetHitKindNV,
    Opcode::HitObjectGetObjectRayOriginEXT,
    Opcode::HitObjectGetObjectRayOriginNV,
    Opcode::HitObjectGetObjectRayDirectionEXT,
    Opcode::HitObjectGetObjectRayDirectionNV,
    Opcode::HitObjectGetObjectToWorldEXT,
    Opcode::HitObjectGetObjectToWorldNV,
    Opcode::HitObjectGetWorldToObjectEXT,
    Opcode::HitObjectGetWorldToObjectNV,
    Opcode::HitObjectGetIntersectionTriangleVertexPositionsEXT,
    Opcode::HitObjectGetClusterIdNV,
    Opcode::HitObjectIsSphereHitNV,
    Opcode::HitObjectIsLSSHitNV,
    Opcode::HitObjectGetSpherePositionNV,
    Opcode::HitObjectGetSphereRadiusNV,
    Opcode::HitObjectGetLSSPositionsNV,
    Opcode::HitObjectGetLSSRadiiNV,
];

/// Decodes hit object instructions; `false` for an instruction of another section.
pub fn decode(decoder: &mut Decoder<'_>, opcode: Opcode, instruction: &Instruction) -> Result<bool> {
    if !OPCODES.contains(&opcode) {
        return Ok(false);
    }
    check_stage(decoder, opcode, instruction)?;
    if matches!(opcode, Opcode::ReorderThreadWithHintEXT | Opcode::ReorderThreadWithHintNV) {
        decoder.emit(Operation::HitObject(Op::Reorder));
        return Ok(true);
    }
    let id = decoder.id(instruction, 0)?;
    let object = object(decoder, id, |ty| matches!(ty, Type::HitObject { .. }))?;
    if let Some(getter) = GETTERS.iter().find(|getter| getter.opcodes.contains(&opcode)) {
        let to = result(decoder, instruction, getter.shape)?;
        decoder.emit(Operation::HitObject(Op::Get { object, getter, to }));
        return Ok(true);
    }
    match opcode {
        Opcode::HitObjectTraceRayEXT
        | Opcode::HitObjectTraceRayNV
        | Opcode::HitObjectTraceReorderExecuteEXT => {
            let mut words: SmallVec<[Reg; 16]> = SmallVec::new();
            for at in 1..11 {
                words.extend(decoder.operand(instruction, at)?);
            }
            // The time of a trace without motion.
            words.push(decoder.constant(0)?);
            let operands = whole(decoder, instruction, &words, TRACE_OPERANDS)?;
            let payload = payload(decoder, instruction, 11)?;
            decoder.emit(Operation::Stop(ray_tracing::Op::HitObjectTrace { object, operands, payload }));
            decoder.forget();
            if opcode == Opcode::HitObjectTraceReorderExecuteEXT {
                decoder.emit(Operation::HitObject(Op::Reorder));
                decoder.emit(Operation::Stop(ray_tracing::Op::HitObjectExecute { object, payload }));
            }
        }
        Opcode::HitObjectExecuteShaderEXT
        | Opcode::HitObjectExecuteShaderNV
        | Opcode::HitObjectReorderExecuteShaderEXT => {
            let payload = payload(decoder, instruction, 1)?;
            if opcode == Opcode::HitObjectReorderExecuteShaderEXT {
                decoder.emit(Operation::HitObject(Op::Reorder));
            }
            decoder.emit(Operation::Stop(ray_tracing::Op::HitObjectExecute { object, payload }));
            decoder.forget();
        }
        Opcode::HitObjectGetShaderRecordBufferHandleEXT | Opcode::HitObjectGetShaderRecordBufferHandleNV => {
            let to = result(decoder, instruction, Shape::Int2)?;
            decoder.emit(Operation::Stop(ray_tracing::Op::HitObjectRecordHandle { object, to }));
        }
        Opcode::HitObjectRecordHitNV | Opcode::HitObjectRecordHitWithIndexNV => {
            let with_index = opcode == Opcode::HitObjectRecordHitWithIndexNV;
            let end = if with_index { 11 } else { 12 };
            let operands = operands(decoder, instruction, 1..end, hit_operands(with_index))?;
            let attributes = attributes(decoder, instruction, end)?;
            decoder.emit(Operation::HitObject(Op::RecordHit { object, operands, with_index, attributes }));
        }
        Opcode::HitObjectRecordMissEXT => {
            let operands = operands(decoder, instruction, 1..7, MISS_OPERANDS)?;
            decoder.emit(Operation::HitObject(Op::RecordMiss { object, operands }));
        }
        Opcode::HitObjectRecordMissNV => {
            // This one has no ray flags.
            let mut words: SmallVec<[Reg; 16]> = SmallVec::from_slice(&[decoder.constant(0)?]);
            for at in 1..6 {
                words.extend(decoder.operand(instruction, at)?);
            }
            let operands = whole(decoder, instruction, &words, MISS_OPERANDS)?;
            decoder.emit(Operation::HitObject(Op::RecordMiss { object, operands }));
        }
        Opcode::HitObjectRecordEmptyEXT | Opcode::HitObjectRecordEmptyNV => {
            decoder.emit(Operation::HitObject(Op::RecordEmpty { object }));
        }
        Opcode::HitObjectRecordFromQueryEXT => {
            let query = decoder.id(instruction, 1)?;
            let query = self::object(decoder, query, |ty| matches!(ty, Type::RayQuery))?;
            let record = scalar(decoder, instruction, 2)?;
            let attributes = attributes(decoder, instruction, 3)?;
            let has_kind = decoder.operands(instruction).len() > 4;
            let hit_kind = if has_kind { Some(scalar(decoder, instruction, 4)?) } else { None };
            let op = Op::RecordFromQuery { object, query, record, attributes, hit_kind };
            decoder.emit(Operation::HitObject(op));
        }
        Opcode::HitObjectSetShaderBindingTableRecordIndexEXT => {
            let record = scalar(decoder, instruction, 1)?;
            decoder.emit(Operation::HitObject(Op::SetRecord { object, record }));
        }
        Opcode::HitObjectGetAttributesEXT | Opcode::HitObjectGetAttributesNV => {
            let to = attributes(decoder, instruction, 1)?;
            decoder.emit(Operation::HitObject(Op::GetAttributes { object, to }));
            decoder.forget();
        }
        // OpReorderThreadWithHitObject*
        _ => decoder.emit(Operation::HitObject(Op::Reorder)),
    }
    Ok(true)
}

/// Hit objects are for three stages, reordering for one.
fn check_stage(decoder: &Decoder<'_>, opcode: Opcode, instruction: &Instruction) -> Result<()> {
    let reorders = matches!(
        opcode,
        Opcode::ReorderThreadWithHintEXT
            | Opcode::ReorderThreadWithHintNV
            | Opcode::ReorderThreadWithHitObjectEXT
            | Opcode::ReorderThreadWithHitObjectNV
            | Opcode::HitObjectReorderExecuteShaderEXT
            | Opcode::HitObjectTraceReorderExecuteEXT
    );
    let allowed = match decoder.stage {
        Stage::RayGeneration => true,
        Stage::ClosestHit | Stage::Miss => !reorders,
        _ => false,
    };
    if allowed {
        return Ok(());
    }
    let name = crate::module::names::opcode_name(instruction.opcode);
    let stages = if reorders { "ray generation" } else { "ray generation, closest hit and miss" };
    let found = decoder.stage.name();
    Err(decoder.invalid(format!(
        "{name} in {found}: it is allowed only in {stages} (SPV_EXT_shader_invocation_reorder)"
    )))
}

/// Operands in consecutive rows.
fn operands(
    decoder: &mut Decoder<'_>,
    instruction: &Instruction,
    range: std::ops::Range<usize>,
    count: u32,
) -> Result<Reg> {
    let mut words: SmallVec<[Reg; 16]> = SmallVec::new();
    for at in range {
        words.extend(decoder.operand(instruction, at)?);
    }
    whole(decoder, instruction, &words, count)
}

fn whole(decoder: &mut Decoder<'_>, instruction: &Instruction, words: &[Reg], count: u32) -> Result<Reg> {
    if words.len() != count as usize {
        let name = crate::module::names::opcode_name(instruction.opcode);
        return Err(decoder.invalid(format!("the operands of {name} have wrong types")));
    }
    decoder.consecutive(words)
}

fn scalar(decoder: &mut Decoder<'_>, instruction: &Instruction, at: usize) -> Result<Reg> {
    match decoder.operand(instruction, at)?[..] {
        [reg] => Ok(reg),
        _ => Err(decoder.invalid(format!("operand {at} must be a 32-bit integer"))),
    }
}

fn payload(decoder: &mut Decoder<'_>, instruction: &Instruction, at: usize) -> Result<Rows> {
    let id = decoder.id(instruction, at)?;
    variable_rows(decoder, id, &[storage::RAY_PAYLOAD, storage::INCOMING_RAY_PAYLOAD])
}

fn attributes(decoder: &mut Decoder<'_>, instruction: &Instruction, at: usize) -> Result<Rows> {
    let id = decoder.id(instruction, at)?;
    variable_rows(decoder, id, &[storage::HIT_OBJECT_ATTRIBUTE_EXT, storage::HIT_OBJECT_ATTRIBUTE_NV])
}
