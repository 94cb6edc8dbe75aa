//! The candidates and opaque hits that a traversal has found, in the order of hits.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use crate::accel::hit::{Candidate, Committed, HitKey, HitPrimitive};

/// A candidate in the queue, ordered by key.
#[derive(Clone, Copy, Debug)]
pub(super) struct QueuedCandidate(pub Candidate);

impl QueuedCandidate {
    pub(super) fn key(&self) -> HitKey {
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
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for QueuedCandidate {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        self.key().partial_cmp(&other.key()).expect("bug in anyhit: a hit's t is NaN")
    }
}

/// What a traversal has found.
#[derive(Clone, Debug)]
pub(super) struct HitQueue {
    /// No hit behind it matters; a rounded t.
    pub cull_t: f32,
    pub candidates: BinaryHeap<Reverse<QueuedCandidate>>,
    /// The closest opaque hit found, not yet committed.
    pub closest_opaque: Option<Committed>,
    pub committed: Option<Committed>,
    /// The candidate that the caller decides on.
    pub presented: Option<Candidate>,
    /// The key of the last candidate returned: all later ones lie behind it.
    pub last_presented: Option<HitKey>,
    /// The primitives that an observer has seen, if a ray may reach one several times.
    pub reported: Vec<HitPrimitive>,
    pub any_opaque_hit_ends: bool,
}

impl HitQueue {
    /// Discards all hits and candidates.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
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

    /// Records the candidate that the caller decides on.
    #[inline(always)]
    pub(super) fn present(&mut self, candidate: Candidate) {
        self.last_presented = Some(candidate.key(candidate.intersection.t));
        self.presented = Some(candidate);
    }

    /// Whether a candidate was returned already, and is found again in another leaf.
    #[inline]
    pub(super) fn was_presented(&self, queued: &QueuedCandidate) -> bool {
        self.last_presented.is_some_and(|last| queued.key() <= last)
    }

    /// Records that a primitive is reported to the observer; returns whether for the first time.
    #[cold]
    pub(super) fn is_first_report(&mut self, hit_primitive: HitPrimitive) -> bool {
        let first = !self.reported.contains(&hit_primitive);
        if first {
            self.reported.push(hit_primitive);
        }
        first
    }

    /// Adds an opaque hit; returns whether it is the closest so far.
    #[inline(always)]
    pub(super) fn add_opaque(&mut self, candidate: Candidate) -> bool {
        let Some(hit) = Committed::opaque(candidate) else { return false };
        let others = [&self.closest_opaque, &self.committed];
        let closest = hit.t < self.cull_t || others.into_iter().flatten().all(|other| hit.is_before(other));
        if closest {
            self.closest_opaque = Some(hit);
            self.cull_t = self.cull_t.min(hit.t);
        }
        closest
    }

    /// Commits the closest opaque hit.
    #[inline(always)]
    pub(super) fn commit_closest(&mut self) {
        if let Some(hit) = self.closest_opaque {
            self.committed = Some(hit);
        }
    }

    /// Queues a candidate; returns `false` if it lies behind a hit or was returned already.
    #[inline]
    pub(super) fn queue_candidate(&mut self, candidate: Candidate) -> bool {
        let queued = QueuedCandidate(candidate);
        if self.is_behind(&queued) || self.was_presented(&queued) {
            return false;
        }
        self.candidates.push(Reverse(queued));
        true
    }

    /// The t of the first candidate in the queue.
    #[inline(always)]
    pub(super) fn first_candidate_t(&self) -> Option<f32> {
        self.candidates.peek().map(|Reverse(first)| first.0.intersection.t)
    }

    /// Discards the candidates in the queue.
    #[inline(always)]
    pub(super) fn clear_candidates(&mut self) {
        if !self.candidates.is_empty() {
            self.candidates.clear();
        }
    }

    /// Whether an opaque hit that was found ends the traversal before it is complete.
    #[inline(always)]
    pub(super) fn can_end_early(&self) -> bool {
        self.any_opaque_hit_ends && self.closest_opaque.is_some()
    }

    #[inline]
    pub(super) fn is_behind(&self, queued: &QueuedCandidate) -> bool {
        [&self.closest_opaque, &self.committed].into_iter().flatten().any(|other| other.key() < queued.key())
    }
}
