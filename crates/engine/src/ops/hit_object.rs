//! Hit object instructions (`SPV_EXT_shader_invocation_reorder`,
//! `SPV_NV_shader_invocation_reorder`, and the hit object parts of `SPV_NV_linear_swept_spheres`).
//!
//! Reordering changes no result; it is only counted. The pipeline handles tracing, executing and
//! the address of a shader record: see [`crate::ops::ray_tracing::RayTracingOp`].

use smallvec::SmallVec;

use crate::accel::{Candidate, Committed, GeometryKind, HitKind, RayFlags, RecordIndex, TraceRay};
use crate::geometry::{Intersection, Ray, Surface};
use crate::machine::hit_object::{Attributes, EncodedHit, EncodedRay, HitObject};
use crate::machine::object::ObjectRef;
use crate::machine::stop::RegSpan;
use crate::machine::{AccessFault, Batch, Bindings, Mask, Reg, Registers, TrapCode};
use crate::math::array;
use crate::ops::access::{Access, object_accesses, object_write_accesses};
use crate::ops::memory;

pub use getters::HitObjectGetter;
pub use translate::{OPCODES, has_time, hint_operand, translate};

mod getters;
mod translate;

/// Words of the operands of the instructions that record a miss: ray flags, miss index, origin (3),
/// t min, direction (3), t max, time.
const MISS_OPERANDS: u32 = 11;

/// An operation on hit objects.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "a variant's line tells its fields")]
pub enum HitObjectOp {
    /// `OpHitObjectRecordHitNV`, `OpHitObjectRecordHitWithIndexNV` and those with motion. The
    /// operands: acceleration structure (2), instance, primitive, geometry, hit kind, then SBT
    /// offset and stride or the record's index, origin (3), t min, direction (3), t max, time.
    RecordHit { object: ObjectRef, operands: Reg, with_index: bool, attributes: RegSpan },
    /// `OpHitObjectRecordMissEXT`, `OpHitObjectRecordMissNV` and those with motion.
    RecordMiss { object: ObjectRef, operands: Reg },
    /// `OpHitObjectRecordEmptyEXT`
    RecordEmpty { object: ObjectRef },
    /// `OpHitObjectRecordFromQueryEXT`
    RecordFromQuery {
        object: ObjectRef,
        query: ObjectRef,
        record: Reg,
        attributes: RegSpan,
        hit_kind: Option<Reg>,
    },
    /// `OpHitObjectSetShaderBindingTableRecordIndexEXT`
    SetRecord { object: ObjectRef, record: Reg },
    /// An instruction that reads.
    Get { object: ObjectRef, getter: &'static HitObjectGetter, to: Reg },
    /// `OpHitObjectGetAttributesEXT`
    GetAttributes { object: ObjectRef, to: RegSpan },
    /// `OpReorderThreadWithHintEXT`, `OpReorderThreadWithHitObjectEXT`, with the hint that is
    /// given: it decides nothing here, and what computes it is executed.
    Reorder { hint: Option<Reg> },
}

impl HitObjectOp {
    /// Whether lanes may continue in other subgroups.
    pub(super) fn may_repack(&self) -> bool {
        matches!(self, Self::Reorder { .. })
    }

    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        match *self {
            Self::RecordHit { object, operands, with_index, attributes } => {
                object_write_accesses(object, visit);
                visit(Access::Read(operands, hit_operands(with_index)));
                visit(Access::Read(attributes.first, attributes.count));
            }
            Self::RecordMiss { object, operands } => {
                object_write_accesses(object, visit);
                visit(Access::Read(operands, MISS_OPERANDS));
            }
            Self::RecordEmpty { object } => object_write_accesses(object, visit),
            Self::RecordFromQuery { object, query, record, attributes, hit_kind } => {
                object_write_accesses(object, visit);
                object_accesses(query, visit);
                visit(Access::Read(record, 1));
                visit(Access::Read(attributes.first, attributes.count));
                if let Some(hit_kind) = hit_kind {
                    visit(Access::Read(hit_kind, 1));
                }
            }
            Self::SetRecord { object, record } => {
                object_accesses(object, visit);
                visit(Access::Read(record, 1));
                visit(Access::Effect);
            }
            Self::Get { object, getter, to } => {
                object_accesses(object, visit);
                visit(Access::Write(to, getter.shape.words()));
            }
            Self::GetAttributes { object, to } => {
                object_accesses(object, visit);
                visit(Access::Write(to.first, to.count));
            }
            Self::Reorder { hint } => {
                hint.into_iter().for_each(|hint| visit(Access::Read(hint, 1)));
                visit(Access::Effect);
            }
        }
    }

    /// The hit object that the operation writes or reads; `None` for those that only reorder.
    pub fn object(&self) -> Option<ObjectRef> {
        match *self {
            Self::RecordHit { object, .. }
            | Self::RecordMiss { object, .. }
            | Self::RecordEmpty { object }
            | Self::RecordFromQuery { object, .. }
            | Self::SetRecord { object, .. }
            | Self::Get { object, .. }
            | Self::GetAttributes { object, .. } => Some(object),
            Self::Reorder { .. } => None,
        }
    }

    /// Runs the operation for the running lanes.
    #[inline(never)]
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        match *self {
            Self::RecordHit { object, operands, with_index, attributes } => {
                for_each_lane(batch, |batch, lane| {
                    let words = words(batch, operands, hit_operands(with_index), lane);
                    let attributes =
                        batch.registers.lane_words(attributes.first, attributes.count, lane).collect();
                    let hit = recorded_hit(batch, lane, bindings, &words, with_index, attributes)?;
                    store(batch, object, lane, hit)
                });
            }
            Self::RecordMiss { object, operands } => for_each_lane(batch, |batch, lane| {
                let words = words(batch, operands, MISS_OPERANDS, lane);
                let trace = trace(&words[2..], RayFlags(words[0]));
                check_ray(batch, lane, &trace)?;
                let record = RecordIndex::of_miss(words[1]);
                store(batch, object, lane, HitObject::Miss(EncodedRay::new(trace, record, Some(batch.op))))
            }),
            Self::RecordEmpty { object } => {
                for_each_lane(batch, |batch, lane| store(batch, object, lane, HitObject::Empty));
            }
            Self::RecordFromQuery { object, query, record, attributes, hit_kind } => {
                for_each_lane(batch, |batch, lane| {
                    let record = RecordIndex(batch.registers[record].0[lane].into());
                    let given: Attributes =
                        batch.registers.lane_words(attributes.first, attributes.count, lane).collect();
                    let kind = hit_kind.map_or(0, |reg| batch.registers[reg].0[lane]);
                    let op = batch.op;
                    let register = query.register(&batch.registers, lane)?;
                    let query = batch.queries.query(batch.registers[register].0[lane])?;
                    let Some(&committed) = query.committed() else {
                        return store(batch, object, lane, HitObject::Empty);
                    };
                    let encoded = EncodedRay::new(*query.trace(), record, Some(op));
                    let tlas = query.tlas().clone();
                    let (committed, attributes) = match committed.candidate.is_box() {
                        true => (Committed { hit_kind: HitKind(kind), ..committed }, given),
                        false => (committed, built_in_attributes(&committed.candidate)),
                    };
                    let hit = EncodedHit { tlas, committed, attributes };
                    store(batch, object, lane, HitObject::Hit(encoded, hit))
                });
            }
            Self::SetRecord { object, record } => for_each_lane(batch, |batch, lane| {
                let record = RecordIndex(batch.registers[record].0[lane].into());
                find(batch, object, lane)?.1.set_record(record)
            }),
            Self::Get { object, getter, to } => for_each_lane(batch, |batch, lane| {
                let (registers, object) = find(batch, object, lane)?;
                let mut words = [0; 12];
                let words = &mut words[..getter.shape.words() as usize];
                (getter.read)(object, words)?;
                registers.set_lane_words(to, lane, words.iter().copied());
                Ok(())
            }),
            Self::GetAttributes { object, to } => for_each_lane(batch, |batch, lane| {
                let (registers, object) = find(batch, object, lane)?;
                let attributes = object.hit()?.1.attributes.iter().copied().chain(std::iter::repeat(0));
                registers.set_lane_words(to.first, lane, attributes.take(to.count as usize));
                Ok(())
            }),
            Self::Reorder { .. } => batch.reorders += u64::from(batch.mask.count()),
        }
    }
}

/// Attributes of a triangle, sphere or linear swept sphere, as words.
pub fn built_in_attributes(candidate: &Candidate) -> Attributes {
    candidate.intersection.attributes.iter().map(|attribute| attribute.to_bits()).collect()
}

/// Calls a function for each running lane; lanes that it fails for are stopped.
#[inline(always)]
fn for_each_lane<const W: usize>(
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
    let register = object.register(&batch.registers, lane)?;
    let found = batch.hit_objects.get_mut(batch.registers[register].0[lane]);
    Ok((&mut batch.registers, found.ok_or(TrapCode::HitObjectUnrecorded)?))
}

/// Replaces the hit object of a lane.
///
/// # Errors
/// `IndexOutOfBounds` where the object's variable is an array and its index outside.
pub fn store<const W: usize>(
    batch: &mut Batch<W>,
    object: ObjectRef,
    lane: usize,
    recorded: HitObject,
) -> Result<(), TrapCode> {
    let register = object.register(&batch.registers, lane)?;
    let (handle, place) = batch.hit_objects.get_or_insert(batch.registers[register].0[lane]);
    *place = recorded;
    batch.registers[register].0[lane] = handle;
    Ok(())
}

fn words<const W: usize>(batch: &Batch<W>, first: Reg, count: u32, lane: usize) -> SmallVec<[u32; 17]> {
    batch.registers.lane_words(first, count, lane).collect()
}

/// Origin, t min, direction, t max, time.
fn trace(words: &[u32], flags: RayFlags) -> TraceRay {
    let float = |at: usize| f32::from_bits(words[at]);
    let ray = Ray {
        origin: [float(0), float(1), float(2)],
        t_min: float(3),
        direction: [float(4), float(5), float(6)],
        t_max: float(7),
    };
    TraceRay { ray, flags, cull_mask: 0xFF, time: float(8) }
}

fn check_ray<const W: usize>(batch: &mut Batch<W>, lane: usize, trace: &TraceRay) -> Result<(), TrapCode> {
    trace.check().map_err(|broken| {
        batch.fault_value[lane] = broken as u64;
        TrapCode::InvalidHitObject
    })
}

fn hit_operands(with_index: bool) -> u32 {
    if with_index { 16 } else { 17 }
}

/// The hit that the operands of `OpHitObjectRecordHitNV` and its variants describe.
fn recorded_hit<const W: usize>(
    batch: &mut Batch<W>,
    lane: usize,
    bindings: &Bindings,
    words: &[u32],
    with_index: bool,
    attributes: Attributes,
) -> Result<HitObject, TrapCode> {
    let tlas = bindings.acceleration_structure([words[0], words[1]]);
    let Some(tlas) = tlas else {
        let value = u64::from(words[0]) | u64::from(words[1]) << 32;
        batch.fault_value[lane] = value;
        let fault = AccessFault::structure(value, bindings);
        fault.into_iter().for_each(|fault| batch.record_access_fault(lane, fault));
        return Err(TrapCode::AccelerationStructureMissing);
    };
    let [instance, primitive, geometry, kind] = [words[2], words[3], words[4], words[5]];
    let place = tlas.instances().get(instance as usize);
    let place = place.filter(|place| {
        let data = place.blas.geometries().get(geometry as usize);
        data.is_some_and(|geometry| (primitive as usize) < geometry.data.primitive_count())
    });
    let place = place.ok_or(TrapCode::HitObjectNoPrimitive)?;
    let (record, rest) = match with_index {
        true => (RecordIndex(words[6].into()), &words[7..]),
        false => {
            let record = RecordIndex::of_hit(place.sbt_record_offset, geometry, words[7], words[6]);
            (record, &words[8..])
        }
    };
    let trace = trace(rest, RayFlags(0));
    check_ray(batch, lane, &trace)?;
    let [a, b] = array::map([0, 1], |at| attributes.get(at).map_or(0.0, |&word| f32::from_bits(word)));
    let surface = surface(place.blas.kind(), HitKind(kind));
    let intersection = Intersection { t: trace.ray.t_max, attributes: [a, b], surface };
    let candidate = Candidate { instance, geometry, primitive, intersection, opaque: true };
    let committed = Committed { candidate, t: trace.ray.t_max, hit_kind: HitKind(kind) };
    let hit = EncodedHit { tlas: tlas.clone(), committed, attributes };
    Ok(HitObject::Hit(EncodedRay::new(trace, record, Some(batch.op)), hit))
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
