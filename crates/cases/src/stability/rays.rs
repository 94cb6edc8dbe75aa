//! Rays of shadow values: whether they would hit another primitive.

use std::collections::HashSet;
use std::sync::Arc;

use crate::stability::shadow_value::ShadowValue;
use anyhit_engine::accel::hit::HitPrimitive;
use anyhit_engine::accel::{Candidate, Committed, Cursor, RayFlags, Tlas, TraceRay};
use anyhit_engine::geometry::Ray;
use anyhit_engine::machine::{RayQuery, Reg};

/// The offset of a ray's origin among the operands of its instruction, in words. t min, direction
/// and t max follow the origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RayOperandOffset(pub u32);

impl RayOperandOffset {
    /// The offset in `OpTraceRayKHR` and other instructions that trace.
    pub(super) const TRACE: Self = Self(7);
    /// The offset in `OpRayQueryInitializeKHR`.
    pub(super) const QUERY: Self = Self(4);
    pub(super) const T_MIN: u32 = 3;
    pub(super) const DIRECTION: u32 = 4;
    pub(super) const T_MAX: u32 = 7;
    const COUNT: u32 = 8;

    /// The registers of the ray, given the first register of the operands.
    pub(super) fn registers(self, operands: Reg) -> impl Iterator<Item = Reg> {
        (0..Self::COUNT).map(move |word| operands.plus(self.0 + word))
    }
}

/// The shadow values of a ray's origin, t min, direction and t max.
#[derive(Clone, Debug, Default)]
pub(super) struct RayShadow(pub Vec<Option<ShadowValue>>);

impl RayShadow {
    /// The shadow value of a scalar, counted from the origin on.
    pub(super) fn entry(&self, at: u32) -> Option<ShadowValue> {
        self.0.get(at as usize).copied().flatten()
    }

    /// The ray of shadow values, rounded to f32.
    fn ray(&self, given: &Ray) -> Ray {
        let shadow = |at: u32, own: f32| {
            let entry = self.entry(at).filter(|entry| entry.bits == u64::from(own.to_bits()));
            entry.map_or(own, |entry| entry.value as f32)
        };
        let three = |first: u32, own: [f32; 3]| [0, 1, 2].map(|axis| shadow(first + axis as u32, own[axis]));
        Ray {
            origin: three(0, given.origin),
            t_min: shadow(RayOperandOffset::T_MIN, given.t_min),
            direction: three(RayOperandOffset::DIRECTION, given.direction),
            t_max: shadow(RayOperandOffset::T_MAX, given.t_max),
        }
    }

    /// Whether the ray of shadow values hits another primitive than the run committed. `ignored`
    /// are candidates that shaders ignored; at `last` they terminated the ray.
    pub(super) fn hit_differs(
        &self,
        tlas: &Tlas,
        trace: TraceRay,
        committed: Option<&Committed>,
        ignored: &HashSet<PrimitiveKey>,
        last: Option<PrimitiveKey>,
    ) -> bool {
        let other = TraceRay { ray: self.ray(&trace.ray), ..trace };
        // The hits that an intersection shader would report, or a query generate, are unknown.
        let is_box = committed.is_some_and(|hit| hit.candidate.is_box());
        if other.ray == trace.ray || other.check().is_err() || is_box {
            return false;
        }
        let mut cursor = Cursor::new(tlas, other);
        while let Some(candidate) = cursor.proceed(tlas) {
            let key = primitive_key(candidate.hit_primitive());
            if !candidate.is_box() && !ignored.contains(&key) {
                cursor.confirm();
            }
            if last == Some(key) {
                break;
            }
        }
        let primitive_of = |hit: &Committed| primitive_key(hit.candidate.hit_primitive());
        cursor.committed().map(primitive_of) != committed.map(primitive_of)
    }
}

/// The instance, geometry and primitive of a hit.
pub(super) type PrimitiveKey = (u32, u32, u32);

pub(super) fn primitive_key(hit: HitPrimitive) -> PrimitiveKey {
    (hit.instance, hit.geometry, hit.primitive)
}

/// A ray that a shader traces, with its shadow values.
#[derive(Debug, Default)]
pub(super) struct ShadowedTrace {
    pub payload: Vec<Option<ShadowValue>>,
    pub ray_shadow: RayShadow,
    pub traced: Option<(Arc<Tlas>, TraceRay)>,
    pub candidate: Option<PrimitiveKey>,
    pub ignored: HashSet<PrimitiveKey>,
    /// Hit distance and attributes of the last report, and of the last accepted one.
    pub reported: (Option<ShadowValue>, Vec<Option<ShadowValue>>),
    pub accepted: (Option<ShadowValue>, Vec<Option<ShadowValue>>),
}

impl ShadowedTrace {
    /// Whether the ray of shadow values hits another primitive; `flags` are the pipeline's.
    pub(super) fn hit_differs(&self, committed: Option<&Committed>, flags: u32) -> bool {
        let Some((tlas, trace)) = &self.traced else { return false };
        let trace = TraceRay { flags: RayFlags(trace.flags.0 | flags), ..*trace };
        self.ray_shadow.hit_differs(tlas, trace, committed, &self.ignored, None)
    }
}

/// A ray query that was initialised, with its shadow values.
#[derive(Debug, Default)]
pub(super) struct ShadowedQuery {
    pub ray_shadow: RayShadow,
    candidate: Option<PrimitiveKey>,
    /// Whether the candidate was confirmed.
    confirmed: bool,
    ignored: HashSet<PrimitiveKey>,
    terminated: bool,
    /// Whether `OpRayQueryProceedKHR` returned false.
    complete: bool,
    /// Whether a difference was reported before.
    is_reported: bool,
}

impl ShadowedQuery {
    /// A query whose ray has these shadow values.
    pub(super) fn new(ray_shadow: RayShadow) -> Self {
        Self { ray_shadow, ..Self::default() }
    }

    pub(super) fn confirm(&mut self) {
        self.confirmed = true;
    }

    pub(super) fn terminate(&mut self) {
        self.terminated = true;
    }

    /// The query proceeds to a candidate, or to its end.
    pub(super) fn proceed(&mut self, to: Option<&Candidate>) {
        if let Some(before) = self.candidate.filter(|_| !self.confirmed) {
            self.ignored.insert(before);
        }
        self.complete = to.is_none();
        // A query that was terminated ended at its last candidate.
        if !self.terminated {
            (self.candidate, self.confirmed) =
                (to.map(|candidate| primitive_key(candidate.hit_primitive())), false);
        }
    }

    /// Whether the ray of shadow values has another committed hit by now; true at most once. A
    /// query in progress is compared only after a hit was confirmed.
    pub(super) fn hit_differs(&mut self, query: &RayQuery) -> bool {
        let mut ignored = self.ignored.clone();
        ignored.extend(self.candidate.filter(|_| !self.confirmed));
        let differs = !self.is_reported
            && (self.complete || self.confirmed)
            && self.ray_shadow.hit_differs(
                query.tlas(),
                *query.trace(),
                query.committed(),
                &ignored,
                self.candidate,
            );
        self.is_reported |= differs;
        differs
    }
}
