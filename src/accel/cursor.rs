//! The resumable traversal of one ray: for traces and for ray queries.

use crate::accel::tlas::Tlas;
use crate::geometry::{Intersection, Ray};

/// Ray flags, numbers as in SPIR-V.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct RayFlags(pub u32);

/// A hit kind: 254 and 255 for triangles, 0 to 127 for reported ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct HitKind(pub u32);

impl HitKind {
    /// `HitKindFrontFacingTriangleKHR`
    pub const FRONT_FACING_TRIANGLE: Self = Self(0xFE);
    /// `HitKindBackFacingTriangleKHR`
    pub const BACK_FACING_TRIANGLE: Self = Self(0xFF);
    /// A sphere; no public number exists, this one is ours.
    pub const SPHERE: Self = Self(0x80);
    /// A linear swept sphere; no public number exists, this one is ours.
    pub const LINEAR_SWEPT_SPHERE: Self = Self(0x81);
}

/// The operands of a trace that traversal needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceRay {
    /// The ray.
    pub ray: Ray,
    /// The ray's flags.
    pub flags: RayFlags,
    /// Its low 8 bits count.
    pub cull_mask: u32,
}

/// A primitive that needs a decision: a non-opaque one (any-hit) or a box (intersection shader).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// `InstanceId`
    pub instance: u32,
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
    /// Where; for a box its entry.
    pub intersection: Intersection,
    /// Whether a hit of it is opaque (a box: no any-hit after a report).
    pub opaque: bool,
}

/// The closest hit so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Committed {
    /// What was hit.
    pub candidate: Candidate,
    /// The ray parameter (for a generated hit, the reported one).
    pub t: f32,
    /// The hit kind.
    pub hit_kind: HitKind,
}

/// A traversal in progress.
#[derive(Clone, Debug)]
pub struct Cursor {
    trace: TraceRay,
}

impl Cursor {
    /// Begins a traversal.
    pub fn new(_tlas: &Tlas, trace: TraceRay) -> Self {
        Self { trace }
    }

    /// The operands of the trace.
    pub fn trace(&self) -> &TraceRay {
        &self.trace
    }
}
