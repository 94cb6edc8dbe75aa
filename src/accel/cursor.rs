//! The resumable traversal of one ray: for traces and for ray queries.
//!
//! # Order
//! A traversal runs *as if* all primitives that the ray hits were in one list, ascending by their
//! key (t, instance, geometry, primitive), t being the correctly rounded f32, for a box its entry,
//! and the list were visited from its start:
//!
//! * an opaque triangle, sphere or LSS commits, silently;
//! * any other primitive is returned as a [`Candidate`]; the caller confirms it, reports hits in it
//!   (a box), or ignores it;
//! * the traversal ends at the first entry whose key lies behind the committed hit's key, at the
//!   end of the list, or when the caller terminates it.
//!
//! So the candidates, their order, `t_max` meanwhile and the committed hit depend only on the ray
//! and the scene, never on trees, threads or batches. In particular an opaque hit behind a
//! candidate is not yet committed when that candidate is returned, even if traversal has found it
//! already; and under `TerminateOnFirstHitKHR` the hit that counts is the first of the list that is
//! confirmed.
//!
//! A hit reported in a box can lie anywhere behind the box's entry; it is accepted if it lies
//! within `t_min..=t_max()` and, at equal t, if its key is not behind the committed one's. A later
//! report in the same box at equal t replaces the earlier.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use crate::accel::observer::{ErasedObserver, HitPrimitive, ObserverAdapter, TraversalObserver};
use crate::accel::primitive::Primitive;
pub use crate::accel::rules::{RayFlags, RayRule};
use crate::accel::tlas::{Tlas, TlasInstance};
use crate::accel::traversal::TraversalState;
use crate::geometry::{Intersection, Ray, Surface};

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

/// The operands of a trace or ray query that traversal needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceRay {
    /// The ray in world space, with its interval.
    pub ray: Ray,
    /// The flags of the ray.
    pub flags: RayFlags,
    /// Only the low 8 bits are used.
    pub cull_mask: u32,
    /// `CurrentRayTimeNV`, from 0 to 1: the time for moving geometry. 0 for instructions without
    /// one.
    pub time: f32,
}

impl TraceRay {
    /// Whether the operands keep the rules.
    ///
    /// # Errors
    /// The first rule that they break.
    #[doc(hidden)]
    #[inline]
    pub fn check(&self) -> Result<(), RayRule> {
        let Ray { origin, direction, t_min, t_max } = self.ray;
        let finite = origin.iter().chain(&direction).all(|value| value.is_finite());
        let interval = t_min >= 0.0 && t_min <= t_max;
        let time = (0.0..=1.0).contains(&self.time);
        let exclusive = |bits: u32| (self.flags.0 & bits).count_ones() <= 1;
        let flags = exclusive(1 | 2 | 64 | 128) && exclusive(256 | 16 | 32) && exclusive(256 | 512);
        if finite && interval && flags && time { Ok(()) } else { Err(self.broken_rule()) }
    }

    #[cold]
    fn broken_rule(&self) -> RayRule {
        let Ray { origin, direction, t_min, t_max } = self.ray;
        let exclusive = |bits: u32| (self.flags.0 & bits).count_ones() <= 1;
        let components = || origin.iter().chain(&direction);
        match () {
            () if components().any(|x| x.is_nan()) || t_min.is_nan() || t_max.is_nan() => RayRule::NotNan,
            () if !components().all(|x| x.is_finite()) => RayRule::Finite,
            () if t_min < 0.0 || t_max < 0.0 => RayRule::NotNegative,
            () if t_min > t_max => RayRule::InOrder,
            () if !exclusive(1 | 2 | 64 | 128) => RayRule::OpacityFlags,
            () if !exclusive(256 | 512) => RayRule::SkipFlags,
            () if !exclusive(256 | 16 | 32) => RayRule::TriangleFlags,
            () => RayRule::Time,
        }
    }
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

    /// The key by which hits are ordered, as the head of this file defines it.
    #[inline]
    fn key(&self, t: f32) -> HitKey {
        HitKey { t, instance: self.instance, geometry: self.geometry, primitive: self.primitive }
    }
}

/// The order of hits. t is never NaN.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct HitKey {
    t: f32,
    instance: u32,
    geometry: u32,
    primitive: u32,
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

    fn key(&self) -> HitKey {
        self.candidate.key(self.t)
    }
}

/// A candidate in the queue, ordered by key.
#[derive(Clone, Copy, Debug)]
struct QueuedCandidate(Candidate);

impl QueuedCandidate {
    fn key(&self) -> HitKey {
        self.0.key(self.0.intersection.t)
    }
}

impl PartialEq for QueuedCandidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for QueuedCandidate {}

impl PartialOrd for QueuedCandidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for QueuedCandidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.key().partial_cmp(&other.key()).expect("bug in anyhit: a hit's t is NaN")
    }
}

/// How far a traversal is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Not started.
    Fresh,
    Underway,
    /// No further candidate and no further commit.
    Ended,
}

/// A traversal in progress. It holds no borrow: the same [`Tlas`] is passed to each step.
#[derive(Clone, Debug)]
pub struct Cursor {
    pub(super) trace: TraceRay,
    pub(super) traversal: TraversalState,
    pub(super) hits: HitQueue,
    state: State,
}

/// What a traversal has found.
#[derive(Clone, Debug)]
pub(super) struct HitQueue {
    /// No hit behind it matters; a rounded t.
    pub cull_t: f32,
    candidates: BinaryHeap<Reverse<QueuedCandidate>>,
    /// The closest opaque hit found, not yet committed.
    closest_opaque: Option<Committed>,
    committed: Option<Committed>,
    /// The candidate that the caller decides on.
    presented: Option<Candidate>,
    /// The key of the last candidate returned: all later ones lie behind it.
    last_presented: Option<HitKey>,
    /// The primitives that an observer has seen, if a ray may reach one several times.
    reported: Vec<HitPrimitive>,
    any_opaque_hit_ends: bool,
}

impl Cursor {
    /// Begins a traversal. A ray with a NaN, or with an infinite origin or direction, hits nothing.
    pub fn new(_tlas: &Tlas, trace: TraceRay) -> Self {
        Self::fresh(trace)
    }

    /// A cursor without a ray, whose buffers serve later traversals.
    pub(super) fn empty() -> Self {
        let ray = Ray::new([0.0; 3], [0.0; 3]);
        Self::fresh(TraceRay { ray, flags: RayFlags::default(), cull_mask: 0, time: 0.0 })
    }

    fn fresh(trace: TraceRay) -> Self {
        let hits = HitQueue {
            cull_t: trace.ray.t_max,
            candidates: BinaryHeap::new(),
            closest_opaque: None,
            committed: None,
            presented: None,
            last_presented: None,
            reported: Vec::new(),
            any_opaque_hit_ends: false,
        };
        Self { trace, traversal: TraversalState::EMPTY, hits, state: State::Fresh }
    }

    /// Begins another traversal and reuses the buffers of this one.
    #[inline]
    pub fn reset(&mut self, _tlas: &Tlas, trace: TraceRay) {
        self.trace = trace;
        self.hits.clear();
        self.hits.cull_t = trace.ray.t_max;
        self.state = State::Fresh;
    }

    /// Makes the traversal end at *any* opaque hit, the first one found. For occlusion rays: the
    /// caller must ensure that nothing observes which hit was committed, or which candidates were
    /// returned before.
    pub fn end_at_any_opaque_hit(&mut self) {
        self.hits.any_opaque_hit_ends = true;
    }

    /// The operands of the trace.
    pub fn trace(&self) -> &TraceRay {
        &self.trace
    }

    /// Advances to the next candidate; `None` at the end. The previous candidate is ignored if it
    /// was not confirmed.
    pub fn proceed(&mut self, tlas: &Tlas) -> Option<Candidate> {
        if self.state == State::Fresh && tlas.is_fully_opaque(self.trace.flags) {
            self.state = State::Ended;
            self.advance::<(), true>(tlas, true, &mut ());
            self.hits.committed = self.hits.closest_opaque;
            return None;
        }
        self.proceed_observed(tlas, &mut ())
    }

    /// Continues as [`Cursor::proceed`] does, and reports the steps to an observer.
    #[inline]
    pub fn proceed_with<V: TraversalObserver>(&mut self, tlas: &Tlas, observer: &mut V) -> Option<Candidate> {
        if V::IS_NOOP {
            self.proceed(tlas)
        } else if V::EXPLAINS_MISSES {
            self.proceed_observed(tlas, &mut ErasedObserver::<true>::new(&mut ObserverAdapter(observer)))
        } else {
            self.proceed_observed(tlas, &mut ErasedObserver::<false>::new(&mut ObserverAdapter(observer)))
        }
    }

    fn proceed_observed<V: TraversalObserver>(&mut self, tlas: &Tlas, observer: &mut V) -> Option<Candidate> {
        let start = match self.state {
            State::Fresh => true,
            State::Underway => false,
            State::Ended => {
                self.hits.presented = None;
                return None;
            }
        };
        self.state = State::Underway;
        self.hits.presented = None;
        let next = self.next_candidate(tlas, start, observer);
        if next.is_none() {
            self.finish(observer);
        }
        next
    }

    /// The next candidate; `None` if the closest opaque hit precedes all that are left.
    fn next_candidate<V: TraversalObserver>(
        &mut self,
        tlas: &Tlas,
        mut start: bool,
        observer: &mut V,
    ) -> Option<Candidate> {
        loop {
            if let Some(&Reverse(first)) = self.hits.candidates.peek()
                && self.traversal.is_past(first.0.intersection.t)
            {
                self.hits.candidates.pop();
                if self.hits.is_behind(&first) {
                    return None;
                }
                if self.hits.was_presented(&first) {
                    continue;
                }
                self.hits.last_presented = Some(first.key());
                self.hits.presented = Some(first.0);
                observer.present(&first.0);
                return Some(first.0);
            }
            if !self.advance::<V, false>(tlas, start, observer) {
                return None;
            }
            start = false;
        }
    }

    /// Commits the candidate that [`Cursor::proceed`] returned last (not a box); this ends the
    /// traversal, as all other hits lie behind. Returns whether there was one to commit.
    pub fn confirm(&mut self) -> bool {
        let Some(candidate) = self.hits.presented.filter(|candidate| !candidate.is_box()) else {
            return false;
        };
        let Some(hit_kind) = candidate.hit_kind() else { return false };
        self.hits.committed = Some(Committed { candidate, t: candidate.intersection.t, hit_kind });
        self.terminate();
        true
    }

    /// Whether a hit at t in the current box would be accepted now.
    #[inline]
    pub fn accepts(&self, t: f32) -> bool {
        let Some(candidate) = self.hits.presented.filter(Candidate::is_box) else { return false };
        let in_interval = t >= self.trace.ray.t_min && t <= self.t_max();
        in_interval && self.hits.committed.is_none_or(|committed| candidate.key(t) <= committed.key())
    }

    /// Commits a hit at t in the current box if it is accepted; returns whether it was. One box may
    /// have several.
    pub fn generate(&mut self, t: f32, hit_kind: HitKind) -> bool {
        let Some(candidate) = self.hits.presented.filter(|_| self.accepts(t)) else { return false };
        self.hits.committed = Some(Committed { candidate, t, hit_kind });
        self.hits.cull_t = self.hits.cull_t.min(t);
        if self.trace.flags.contains(RayFlags::TERMINATE_ON_FIRST_HIT) {
            self.terminate();
        }
        true
    }

    /// Ends the traversal; the committed hit stays, and nothing is added.
    pub fn terminate(&mut self) {
        self.state = State::Ended;
        let committed = self.hits.committed;
        self.hits.clear();
        self.hits.committed = committed;
    }

    /// The candidate that the caller decides on.
    pub fn candidate(&self) -> Option<&Candidate> {
        self.hits.presented.as_ref()
    }

    /// The closest hit so far; after the end, the hit.
    #[inline]
    pub fn committed(&self) -> Option<&Committed> {
        self.hits.committed.as_ref()
    }

    /// The current `RayTmaxKHR`: the committed t, or the ray's own.
    #[inline]
    pub fn t_max(&self) -> f32 {
        self.hits.committed.map_or(self.trace.ray.t_max, |committed| committed.t)
    }

    /// Commits the closest opaque hit and ends the traversal: no candidate precedes it.
    fn finish(&mut self, observer: &mut impl TraversalObserver) {
        if let Some(hit) = self.hits.closest_opaque.take()
            && self.hits.committed.is_none_or(|committed| hit.key() < committed.key())
        {
            self.hits.committed = Some(hit);
            observer.commit(&hit);
        }
        observer.end(self.traversal.is_over());
        self.terminate();
    }
}

impl HitQueue {
    /// Discards all hits and candidates.
    #[inline(always)]
    fn clear(&mut self) {
        self.clear_candidates();
        self.closest_opaque = None;
        self.committed = None;
        self.presented = None;
        self.last_presented = None;
        if !self.reported.is_empty() {
            self.reported.clear();
        }
        self.any_opaque_hit_ends = false;
    }

    /// Whether a candidate was returned already, and is found again in another leaf.
    fn was_presented(&self, queued: &QueuedCandidate) -> bool {
        self.last_presented.is_some_and(|last| queued.key() <= last)
    }

    /// Records that a primitive is reported to the observer; returns whether for the first time.
    #[cold]
    pub fn is_first_report(&mut self, hit_primitive: HitPrimitive) -> bool {
        let first = !self.reported.contains(&hit_primitive);
        if first {
            self.reported.push(hit_primitive);
        }
        first
    }

    /// Adds an opaque hit; returns whether it is the closest so far.
    #[inline(always)]
    pub fn add_opaque(&mut self, candidate: Candidate) -> bool {
        let Some(hit) = Committed::opaque(candidate) else { return false };
        let others = [&self.closest_opaque, &self.committed];
        let closest = hit.t < self.cull_t || others.into_iter().flatten().all(|other| hit.is_before(other));
        if closest {
            self.closest_opaque = Some(hit);
            self.cull_t = self.cull_t.min(hit.t);
        }
        closest
    }

    /// Queues a candidate; returns `false` if it lies behind a hit or was returned already.
    #[inline]
    pub fn queue_candidate(&mut self, candidate: Candidate) -> bool {
        let queued = QueuedCandidate(candidate);
        if self.is_behind(&queued) || self.was_presented(&queued) {
            return false;
        }
        self.candidates.push(Reverse(queued));
        true
    }

    /// The t of the first candidate in the queue.
    #[inline(always)]
    pub fn first_candidate_t(&self) -> Option<f32> {
        self.candidates.peek().map(|Reverse(first)| first.0.intersection.t)
    }

    /// Discards the candidates in the queue.
    #[inline(always)]
    pub fn clear_candidates(&mut self) {
        if !self.candidates.is_empty() {
            self.candidates.clear();
        }
    }

    /// Whether an opaque hit that was found ends the traversal before it is complete.
    #[inline(always)]
    pub fn can_end_early(&self) -> bool {
        self.any_opaque_hit_ends && self.closest_opaque.is_some()
    }

    fn is_behind(&self, queued: &QueuedCandidate) -> bool {
        [&self.closest_opaque, &self.committed].into_iter().flatten().any(|other| other.key() < queued.key())
    }
}
