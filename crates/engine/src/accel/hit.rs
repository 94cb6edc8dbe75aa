//! Candidates and committed hits, and the order of hits (`cursor` defines it).

use serde::Serialize;

use crate::accel::instance::TlasInstance;
use crate::accel::primitive::Primitive;
use crate::accel::tlas::Tlas;
use crate::geometry::{Intersection, Surface};

/// A hit kind: 254 and 255 for triangles, 0 to 127 for reported ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
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

/// A primitive that needs a decision: a non-opaque one (any-hit) or a box (intersection shader).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// `InstanceId`
    pub instance: u32,
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
    /// Where the ray hits it; for a box, its entry. A triangle's facing is that in its instance
    /// (`TRIANGLE_FLIP_FACING` flips it).
    pub intersection: Intersection,
    /// Whether it is opaque (a box: no any-hit shader runs after a report).
    pub opaque: bool,
}

impl Candidate {
    /// Whether it is a box, in which an intersection shader looks for hits.
    #[inline]
    pub fn is_box(&self) -> bool {
        self.intersection.surface == Surface::Aabb
    }

    /// The hit kind; `None` for a box, where the report gives it.
    #[inline]
    pub fn hit_kind(&self) -> Option<HitKind> {
        match self.intersection.surface {
            Surface::TriangleFront => Some(HitKind::FRONT_FACING_TRIANGLE),
            Surface::TriangleBack => Some(HitKind::BACK_FACING_TRIANGLE),
            Surface::Aabb => None,
            Surface::Sphere => Some(HitKind::SPHERE),
            Surface::Side | Surface::Cap0 | Surface::Cap1 => Some(HitKind::LINEAR_SWEPT_SPHERE),
        }
    }

    /// The identity of the primitive.
    #[inline]
    pub fn hit_primitive(&self) -> HitPrimitive {
        HitPrimitive { instance: self.instance, geometry: self.geometry, primitive: self.primitive }
    }

    /// The instance that it belongs to.
    ///
    /// # Panics
    /// If the structure is not the one in which it was found.
    #[inline]
    pub fn instance_in<'a>(&self, tlas: &'a Tlas) -> &'a TlasInstance {
        &tlas.instances()[self.instance as usize]
    }

    /// The numbers of the primitive at the ray's time.
    ///
    /// # Panics
    /// As [`Candidate::instance_in`].
    pub fn primitive_in(&self, tlas: &Tlas, time: f32) -> Option<Primitive> {
        self.instance_in(tlas).blas.primitive(self.geometry, self.primitive, time)
    }

    /// `ClusterIDNV`: -1 where the primitive belongs to no cluster.
    ///
    /// # Panics
    /// As [`Candidate::instance_in`].
    pub fn cluster_id(&self, tlas: &Tlas) -> u32 {
        let geometries = self.instance_in(tlas).blas.geometries();
        geometries[self.geometry as usize].cluster_id.unwrap_or(u32::MAX)
    }

    /// The key by which hits are ordered, as `cursor` defines it.
    #[inline]
    pub(super) fn key(&self, t: f32) -> HitKey {
        HitKey { t, instance: self.instance, geometry: self.geometry, primitive: self.primitive }
    }
}

/// The order of hits. t is never NaN.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct HitKey {
    t: f32,
    instance: u32,
    geometry: u32,
    primitive: u32,
}

impl HitKey {
    /// The rounded t of the hit.
    #[inline(always)]
    pub(super) fn t(&self) -> f32 {
        self.t
    }
}

/// The closest hit so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Committed {
    /// The primitive that was hit.
    pub candidate: Candidate,
    /// The ray parameter (for a reported hit, the reported one).
    pub t: f32,
    /// The hit kind.
    pub hit_kind: HitKind,
}

impl Committed {
    /// The hit of an opaque candidate; `None` for a box.
    #[inline(always)]
    pub(super) fn opaque(candidate: Candidate) -> Option<Self> {
        let hit_kind = candidate.hit_kind()?;
        Some(Self { candidate, t: candidate.intersection.t, hit_kind })
    }

    /// Whether it comes before another one in the list of all hits.
    #[inline(always)]
    pub(super) fn is_before(&self, other: &Self) -> bool {
        self.key() < other.key()
    }

    pub(super) fn key(&self) -> HitKey {
        self.candidate.key(self.t)
    }
}

/// The identity of a primitive in a TLAS.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct HitPrimitive {
    /// `InstanceId`
    pub instance: u32,
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
}
