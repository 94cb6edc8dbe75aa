//! Hit objects: the result of a traversal, or one that a shader records, to be read and executed
//! later (`SPV_EXT_shader_invocation_reorder`, `SPV_NV_shader_invocation_reorder`).
//!
//! As with ray queries, a variable is one register with a handle into the batch's list.

use std::sync::Arc;

use smallvec::SmallVec;

use crate::accel::{Committed, RecordIndex, Tlas, TraceRay};
use crate::machine::index::OpIndex;
use crate::machine::object::ObjectPool;
use crate::machine::trap::TrapCode;

/// Words of hit attributes.
pub type Attributes = SmallVec<[u32; 8]>;

/// A hit object. Uses that the specifications leave undefined give a [`TrapCode`].
#[derive(Clone, Debug, Default)]
pub enum HitObject {
    /// Nothing was recorded yet.
    #[default]
    Unrecorded,
    /// Neither a hit nor a miss: executing it does nothing.
    Empty,
    /// A miss.
    Miss(EncodedRay),
    /// A hit.
    Hit(EncodedRay, EncodedHit),
}

/// The ray and the shader record of a hit or miss.
#[derive(Clone, Debug)]
pub struct EncodedRay {
    /// The ray; `t_max` is the trace's.
    pub trace: TraceRay,
    /// The index into the miss or the hit table.
    pub record: RecordIndex,
    /// What recorded it.
    pub origin: HitObjectOrigin,
}

/// What recorded a hit object. Only observers of shaders ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HitObjectOrigin {
    /// The operation; `None` where a test stands in for the pipeline.
    pub op: Option<OpIndex>,
    /// The record's index before `OpHitObjectSetShaderBindingTableRecordIndexEXT` changed it.
    pub record: RecordIndex,
}

impl EncodedRay {
    /// A ray and its record, as an operation records them.
    pub fn new(trace: TraceRay, record: RecordIndex, op: Option<OpIndex>) -> Self {
        Self { trace, record, origin: HitObjectOrigin { op, record } }
    }
}

/// The hit of a hit object, beside its ray.
#[derive(Clone, Debug)]
pub struct EncodedHit {
    /// The acceleration structure.
    pub tlas: Arc<Tlas>,
    /// Primitive, t and hit kind.
    pub committed: Committed,
    /// The attributes.
    pub attributes: Attributes,
}

impl HitObject {
    /// Whether it is `(empty, miss, hit)`.
    ///
    /// # Errors
    /// `HitObjectUnrecorded`
    pub fn state(&self) -> Result<[bool; 3], TrapCode> {
        match self {
            Self::Unrecorded => Err(TrapCode::HitObjectUnrecorded),
            Self::Empty => Ok([true, false, false]),
            Self::Miss(_) => Ok([false, true, false]),
            Self::Hit(..) => Ok([false, false, true]),
        }
    }

    /// The ray and the shader record of a hit or miss.
    ///
    /// # Errors
    /// `HitObjectUnrecorded`, `HitObjectEmpty`
    pub fn encoded(&self) -> Result<&EncodedRay, TrapCode> {
        match self {
            Self::Unrecorded => Err(TrapCode::HitObjectUnrecorded),
            Self::Empty => Err(TrapCode::HitObjectEmpty),
            Self::Miss(encoded) | Self::Hit(encoded, _) => Ok(encoded),
        }
    }

    /// `OpHitObjectSetShaderBindingTableRecordIndexEXT`
    ///
    /// # Errors
    /// As [`HitObject::encoded`].
    pub fn set_record(&mut self, record: RecordIndex) -> Result<(), TrapCode> {
        self.encoded()?;
        if let Self::Miss(encoded) | Self::Hit(encoded, _) = self {
            encoded.record = record;
        }
        Ok(())
    }

    /// The ray and the hit of a hit.
    ///
    /// # Errors
    /// `HitObjectUnrecorded`, `HitObjectNotHit`
    pub fn hit(&self) -> Result<(&EncodedRay, &EncodedHit), TrapCode> {
        match self {
            Self::Unrecorded => Err(TrapCode::HitObjectUnrecorded),
            Self::Empty | Self::Miss(_) => Err(TrapCode::HitObjectNotHit),
            Self::Hit(encoded, hit) => Ok((encoded, hit)),
        }
    }

    /// `RayTmaxKHR` as the shader sees it that this object executes: the hit's t, or the ray's own.
    ///
    /// # Errors
    /// As [`HitObject::encoded`].
    pub fn t_max(&self) -> Result<f32, TrapCode> {
        Ok(match self {
            Self::Hit(_, hit) => hit.committed.t,
            _ => self.encoded()?.trace.ray.t_max,
        })
    }
}

/// The hit objects of a batch, by handle.
pub type HitObjects = ObjectPool<HitObject>;
