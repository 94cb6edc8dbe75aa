//! Rays with the shadows of their numbers: whether they would hit something else.

use std::collections::HashSet;
use std::sync::Arc;

use crate::accel::observer::HitPrimitive;
use crate::accel::{Candidate, Committed, Cursor, RayFlags, Tlas, TraceRay};
use crate::geometry::Ray;
use crate::harness::stability::shadows::Entry;
use crate::machine::{RayQuery, Reg};

/// Where the numbers of a ray stand among the operands of its instruction, in words: the origin,
/// and behind it t min, direction and t max.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Numbers(pub u32);

impl Numbers {
    /// Of `OpTraceRayKHR` and its like.
    pub const TRACE: Self = Self(7);
    /// Of `OpRayQueryInitializeKHR`.
    pub const QUERY: Self = Self(4);
    pub const T_MIN: u32 = 3;
    pub const DIRECTION: u32 = 4;
    pub const T_MAX: u32 = 7;
    const COUNT: u32 = 8;

    /// Their registers, given the first of the operands.
    pub fn rows(self, operands: Reg) -> impl Iterator<Item = Reg> {
        (0..Self::COUNT).map(move |word| operands.plus(self.0 + word))
    }
}

/// The shadow entries of the numbers of a ray.
#[derive(Clone, Debug, Default)]
pub(super) struct Beside(pub Vec<Option<Entry>>);

impl Beside {
    /// Beside a number, counted from the origin on.
    pub fn entry(&self, at: u32) -> Option<Entry> {
        self.0.get(at as usize).copied().flatten()
    }

    /// The ray of the shadows, rounded to f32.
    fn ray(&self, given: &Ray) -> Ray {
        let shadow = |at: u32, own: f32| {
            let entry = self.entry(at).filter(|entry| entry.bits == u64::from(own.to_bits()));
            entry.map_or(own, |entry| entry.value as f32)
        };
        let three = |first: u32, own: [f32; 3]| [0, 1, 2].map(|axis| shadow(first + axis as u32, own[axis]));
        Ray {
            origin: three(0, given.origin),
            t_min: shadow(Numbers::T_MIN, given.t_min),
            direction: three(Numbers::DIRECTION, given.direction),
            t_max: shadow(Numbers::T_MAX, given.t_max),
        }
    }

    /// Whether the ray of the shadows hits something else than what the run committed. `ignored`
    /// are candidates that its shaders did not take, at `last` they ended the ray.
    pub fn other_hit(
        &self,
        tlas: &Tlas,
        trace: TraceRay,
        committed: Option<&Committed>,
        ignored: &HashSet<Key>,
        last: Option<Key>,
    ) -> bool {
        let other = TraceRay { ray: self.ray(&trace.ray), ..trace };
        // What an intersection shader would report, or a query generate, is not known.
        let is_box = committed.is_some_and(|hit| hit.candidate.is_box());
        if other.ray == trace.ray || other.check().is_err() || is_box {
            return false;
        }
        let mut cursor = Cursor::new(tlas, other);
        while let Some(candidate) = cursor.proceed(tlas) {
            let key = key(candidate.hit_primitive());
            if !candidate.is_box() && !ignored.contains(&key) {
                cursor.confirm();
            }
            if last == Some(key) {
                break;
            }
        }
        let place = |hit: &Committed| key(hit.candidate.hit_primitive());
        cursor.committed().map(place) != committed.map(place)
    }
}

/// A primitive of an instance.
pub(super) type Key = (u32, u32, u32);

pub(super) fn key(place: HitPrimitive) -> Key {
    (place.instance, place.geometry, place.primitive)
}

/// A ray that a shader traced, on its way.
#[derive(Debug, Default)]
pub(super) struct Traced {
    pub payload: Vec<Option<Entry>>,
    pub beside: Beside,
    pub traced: Option<(Arc<Tlas>, TraceRay)>,
    pub candidate: Option<Key>,
    pub ignored: HashSet<Key>,
    /// Hit distance and attributes of the last report, and of the last accepted one.
    pub reported: (Option<Entry>, Vec<Option<Entry>>),
    pub accepted: (Option<Entry>, Vec<Option<Entry>>),
}

impl Traced {
    /// Whether it would have hit something else; `flags` are the pipeline's.
    pub fn other_hit(&self, committed: Option<&Committed>, flags: u32) -> bool {
        let Some((tlas, trace)) = &self.traced else { return false };
        let trace = TraceRay { flags: RayFlags(trace.flags.0 | flags), ..*trace };
        self.beside.other_hit(tlas, trace, committed, &self.ignored, None)
    }
}

/// A ray query that was initialised.
#[derive(Debug, Default)]
pub(super) struct Queried {
    pub beside: Beside,
    candidate: Option<Key>,
    /// Whether the candidate was confirmed.
    confirmed: bool,
    ignored: HashSet<Key>,
    terminated: bool,
    /// Whether `OpRayQueryProceedKHR` returned false.
    complete: bool,
    /// Whether it is known to hit something else already.
    other: bool,
}

impl Queried {
    /// Of a query whose ray has these shadows.
    pub fn new(beside: Beside) -> Self {
        Self { beside, ..Self::default() }
    }

    pub fn confirm(&mut self) {
        self.confirmed = true;
    }

    pub fn terminate(&mut self) {
        self.terminated = true;
    }

    /// It went on to a candidate, or to its end.
    pub fn proceed(&mut self, to: Option<&Candidate>) {
        if let Some(before) = self.candidate.filter(|_| !self.confirmed) {
            self.ignored.insert(before);
        }
        self.complete = to.is_none();
        // A query that was terminated ended at its last candidate.
        if !self.terminated {
            (self.candidate, self.confirmed) = (to.map(|candidate| key(candidate.hit_primitive())), false);
        }
    }

    /// Whether what is committed by now is something else for the ray of the shadows; true once.
    /// While the query is underway nothing is said, but behind a hit that was confirmed.
    pub fn other_hit(&mut self, query: &RayQuery) -> bool {
        let mut ignored = self.ignored.clone();
        ignored.extend(self.candidate.filter(|_| !self.confirmed));
        let other = !self.other
            && (self.complete || self.confirmed)
            && self.beside.other_hit(
                query.tlas(),
                *query.trace(),
                query.committed(),
                &ignored,
                self.candidate,
            );
        self.other |= other;
        other
    }
}
