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
//!
//! Vulkan leaves most of this open. [`Cursor::draw`] draws another order within what it allows, see
//! `drawn_hits`.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::accel::drawn_hits::{DrawnHits, TraversalSeeds};
use crate::accel::flags::RayFlags;
use crate::accel::hit::{Candidate, Committed, HitKey, HitKind};
use crate::accel::hit_queue::HitQueue;
use crate::accel::observer::{TestCounts, TraversalObserver};
use crate::accel::tlas::Tlas;
use crate::accel::trace_ray::TraceRay;
use crate::accel::traversal::{TraversalState, TraversalTask};
use crate::geometry::Ray;
use crate::math::baseline_simd::BaselineSimd;
use crate::math::lane_ops::LaneOps;

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
    /// The state of its traversal, from its first step on: large, and not needed where packets
    /// find all hits.
    traversal: Option<Box<TraversalState>>,
    pub(super) hits: HitQueue,
    state: State,
    /// The next candidate, where it is known ahead.
    next: Option<Candidate>,
    /// The hits that are left in an order that is drawn, if it is.
    drawn: Option<Box<DrawnHits>>,
}

/// Asks for all hits in the interval of a ray.
struct AllHits;

impl TraversalObserver for AllHits {
    fn wants_all_hits(&self) -> bool {
        true
    }
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
        Self { trace, traversal: None, hits, state: State::Fresh, next: None, drawn: None }
    }

    /// Begins another traversal and reuses the buffers of this one.
    #[inline]
    pub fn reset(&mut self, _tlas: &Tlas, trace: TraceRay) {
        self.trace = trace;
        self.hits.clear();
        self.hits.cull_t = trace.ray.t_max;
        self.state = State::Fresh;
        self.next = None;
        self.drawn = None;
        if let Some(state) = &mut self.traversal {
            state.leave_part();
        }
    }

    /// Draws what Vulkan leaves open about the traversal, which has not begun yet. Returns the
    /// seeds of what now differs from this crate's own choice.
    pub fn draw(&mut self, tlas: &Tlas, seeds: TraversalSeeds) -> TraversalSeeds {
        let (drawn, effective) = DrawnHits::new(self.all_hits(tlas), tlas, &self.trace, seeds);
        self.drawn = (effective != TraversalSeeds::default()).then(|| Box::new(drawn));
        effective
    }

    /// All hits in the interval of the ray, in the order of hits; opaque ones hide none.
    pub fn all_hits(&self, tlas: &Tlas) -> Vec<Candidate> {
        let mut all = Self::fresh(self.trace);
        std::iter::from_fn(|| all.proceed_observed(tlas, &mut AllHits)).collect()
    }

    /// The hits that are left, in the order that was drawn; empty where none was.
    pub fn drawn_hits(&self) -> impl Iterator<Item = &Candidate> {
        self.drawn.iter().flat_map(|drawn| drawn.iter())
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

    /// The hit behind which its next one lies, where that is not known and may be found from the
    /// root on; `Some(None)` where it is the first.
    #[inline]
    pub(super) fn behind(&self) -> Option<Option<HitKey>> {
        let is_open = self.state == State::Fresh
            && self.next.is_none()
            && self.drawn.is_none()
            && !self.hits.any_opaque_hit_ends;
        is_open.then_some(self.hits.last_presented)
    }

    /// Takes over the next hit in the order of hits, which was found otherwise; `None` where no hit
    /// is left. The next call of [`Cursor::proceed`] comes to it.
    #[inline]
    pub fn take_next_hit(&mut self, hit: Option<Candidate>) {
        match hit {
            Some(candidate) if !candidate.opaque => self.next = hit,
            _ => {
                // Nothing else is known yet.
                self.hits.committed = hit.and_then(Committed::opaque);
                self.hits.presented = None;
                self.state = State::Ended;
            }
        }
    }

    /// Advances to the next candidate; `None` at the end. The previous candidate is ignored if it
    /// was not confirmed.
    pub fn proceed(&mut self, tlas: &Tlas) -> Option<Candidate> {
        if self.next.is_some() {
            return self.present_next();
        }
        if self.state == State::Fresh && self.drawn.is_none() && tlas.is_fully_opaque(self.trace.flags) {
            let (traversal, hits, trace) = self.parts();
            if !traversal.trace_only_instance(hits, trace, tlas) {
                self.trace_other_opaque(tlas);
            }
            self.state = State::Ended;
            return None;
        }
        if self.traversal.as_ref().is_some_and(|state| state.is_in_part()) {
            let mut nobody: &mut dyn TraversalObserver = &mut ();
            return self.proceed_as(tlas, &mut nobody);
        }
        self.proceed_as(tlas, &mut ())
    }

    /// Traces a ray for which no shader decides ([`Tlas::is_fully_opaque`]) from beginning to end,
    /// by the buffers of this cursor, whose own traversal is over then; returns its hit: the
    /// closest, or with `any_opaque_hit` [any](Cursor::end_at_any_opaque_hit).
    pub fn trace_opaque(
        &mut self,
        tlas: &Tlas,
        trace: &TraceRay,
        any_opaque_hit: bool,
    ) -> Option<&Committed> {
        self.hits.clear();
        self.hits.cull_t = trace.ray.t_max;
        self.hits.any_opaque_hit_ends = any_opaque_hit;
        let (traversal, hits, _) = self.parts();
        if !traversal.trace_only_instance(hits, trace, tlas) {
            self.trace = *trace;
            self.trace_other_opaque(tlas);
        }
        (self.state, self.next) = (State::Ended, None);
        self.hits.committed.as_ref()
    }

    /// Traces a ray for which no shader decides through any structure.
    #[inline(never)]
    fn trace_other_opaque(&mut self, tlas: &Tlas) {
        self.advance::<(), true>(tlas, true, &mut ());
        self.hits.commit_closest();
    }

    /// What a traversal changes, and its ray.
    #[inline(always)]
    fn parts(&mut self) -> (&mut TraversalState, &mut HitQueue, &TraceRay) {
        let Self { traversal, hits, trace, .. } = self;
        (traversal.get_or_insert_with(|| Box::new(TraversalState::EMPTY)), hits, trace)
    }

    /// Comes to the candidate that is known ahead.
    #[inline(never)]
    fn present_next(&mut self) -> Option<Candidate> {
        let candidate = self.next.take()?;
        self.hits.present(candidate);
        Some(candidate)
    }

    /// Continues as [`Cursor::proceed`] does, and reports the steps to an observer.
    #[inline]
    pub fn proceed_observed<V: TraversalObserver>(
        &mut self,
        tlas: &Tlas,
        observer: &mut V,
    ) -> Option<Candidate> {
        if V::is_active() {
            let mut observer: &mut dyn TraversalObserver = observer;
            self.proceed_as(tlas, &mut observer)
        } else {
            self.proceed(tlas)
        }
    }

    /// Continues as [`Cursor::proceed`] does, and counts the nodes and primitives that it tests: as
    /// many as an observer sees that explains misses.
    pub fn proceed_counted(&mut self, tlas: &Tlas, counts: &mut TestCounts) -> Option<Candidate> {
        self.proceed_as(tlas, counts)
    }

    fn proceed_as<V: TraversalObserver>(&mut self, tlas: &Tlas, observer: &mut V) -> Option<Candidate> {
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
        let next = match self.drawn {
            None => self.next_candidate(tlas, start, observer),
            Some(_) => self.next_drawn(observer),
        };
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
                && self.traversal.as_ref().is_none_or(|state| state.is_past(first.0.intersection.t))
            {
                self.hits.candidates.pop();
                if self.hits.is_behind(&first) {
                    return None;
                }
                if self.hits.was_presented(&first) {
                    continue;
                }
                self.hits.present(first.0);
                observer.present(&first.0);
                return Some(first.0);
            }
            if !self.advance::<V, false>(tlas, start, observer) {
                return None;
            }
            start = false;
        }
    }

    /// The next candidate in the order that was drawn; opaque hits before it are committed.
    fn next_drawn(&mut self, observer: &mut impl TraversalObserver) -> Option<Candidate> {
        while let Some(candidate) = self.drawn.as_mut()?.next() {
            if !self.is_open_to(&candidate, candidate.intersection.t) {
                continue;
            }
            match Committed::opaque(candidate).filter(|_| candidate.opaque) {
                Some(hit) => {
                    self.hits.committed = Some(hit);
                    observer.commit(&hit);
                    if self.trace.flags.contains(RayFlags::TERMINATE_ON_FIRST_HIT) {
                        return None;
                    }
                }
                None => {
                    self.hits.presented = Some(candidate);
                    observer.present(&candidate);
                    return Some(candidate);
                }
            }
        }
        None
    }

    /// Whether a hit of a candidate at t is not behind the committed one.
    #[inline]
    fn is_open_to(&self, candidate: &Candidate, t: f32) -> bool {
        let ties_are_drawn = self.drawn.as_ref().is_some_and(|drawn| drawn.ties_are_drawn());
        let Some(committed) = &self.hits.committed else { return t <= self.t_max() };
        if ties_are_drawn { t <= committed.t } else { candidate.key(t) <= committed.key() }
    }

    /// Commits the candidate that [`Cursor::proceed`] returned last (not a box). Where no order is
    /// drawn this ends the traversal, as all other hits lie behind. Returns whether there was one
    /// to commit.
    pub fn confirm(&mut self) -> bool {
        let Some(candidate) = self.hits.presented.filter(|candidate| !candidate.is_box()) else {
            return false;
        };
        let Some(hit_kind) = candidate.hit_kind() else { return false };
        self.hits.committed = Some(Committed { candidate, t: candidate.intersection.t, hit_kind });
        if self.drawn.is_none() || self.trace.flags.contains(RayFlags::TERMINATE_ON_FIRST_HIT) {
            self.terminate();
        }
        true
    }

    /// Whether a hit at t in the current box would be accepted now.
    #[inline]
    pub fn accepts(&self, t: f32) -> bool {
        let Some(candidate) = self.hits.presented.filter(Candidate::is_box) else { return false };
        t >= self.trace.ray.t_min && t <= self.t_max() && self.is_open_to(&candidate, t)
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

    /// Traverses until the next candidate is known; returns `false` if nothing is left to visit.
    /// `start` begins at the root, `FULLY_OPAQUE` says that no candidate is possible.
    fn advance<V: TraversalObserver, const FULLY_OPAQUE: bool>(
        &mut self,
        tlas: &Tlas,
        start: bool,
        observer: &mut V,
    ) -> bool {
        let (traversal, hits, trace) = self.parts();
        let task = TraversalTask::<V, FULLY_OPAQUE> { traversal, hits, trace, tlas, observer, start };
        if V::is_fast() { tlas.cpu_tier().run(task) } else { BaselineSimd.dispatch(task) }
    }

    /// Commits the closest opaque hit and ends the traversal: no candidate precedes it.
    fn finish(&mut self, observer: &mut impl TraversalObserver) {
        if let Some(hit) = self.hits.closest_opaque.take()
            && self.hits.committed.is_none_or(|committed| hit.key() < committed.key())
        {
            self.hits.committed = Some(hit);
            observer.commit(&hit);
        }
        observer.end(self.traversal.as_ref().is_none_or(|state| state.is_over()));
        self.terminate();
    }
}
