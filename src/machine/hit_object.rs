//! Hit objects: what a traversal found, or what a shader says it found, to be read and executed
//! later (`SPV_EXT_shader_invocation_reorder`, `SPV_NV_shader_invocation_reorder`).
//!
//! As with ray queries, a variable is one register with a handle into the batch's list.

use std::sync::Arc;

use smallvec::SmallVec;

use crate::accel::{Committed, Tlas, TraceRay};
use crate::machine::object::Objects;
use crate::machine::trap::TrapCode;

/// Words of hit attributes.
pub type Attributes = SmallVec<[u32; 8]>;

/// What a hit object encodes. What the specifications leave undefined is a [`TrapCode`] here.
#[derive(Clone, Debug, Default)]
pub enum HitObject {
    /// Nothing was recorded yet.
    #[default]
    Unrecorded,
    /// Neither a hit nor a miss: executing it does nothing.
    Empty,
    /// A miss.
    Miss(Encoded),
    /// A hit.
    Hit(Encoded, HitEncoded),
}

/// What hits and misses have.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The ray; `t_max` is the trace's.
    pub trace: TraceRay,
    /// The index into the miss or the hit table.
    pub record: u64,
}

/// What hits have beside.
#[derive(Clone, Debug)]
pub struct HitEncoded {
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

    /// What hits and misses have.
    ///
    /// # Errors
    /// `HitObjectUnrecorded`, `HitObjectEmpty`
    pub fn encoded(&self) -> Result<&Encoded, TrapCode> {
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
    pub fn set_record(&mut self, record: u32) -> Result<(), TrapCode> {
        self.encoded()?;
        if let Self::Miss(encoded) | Self::Hit(encoded, _) = self {
            encoded.record = record.into();
        }
        Ok(())
    }

    /// What hits have.
    ///
    /// # Errors
    /// `HitObjectUnrecorded`, `HitObjectNotHit`
    pub fn hit(&self) -> Result<(&Encoded, &HitEncoded), TrapCode> {
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
pub type HitObjects = Objects<HitObject>;
