//! Cursors that go to their next hits together, as a packet of rays.
//!
//! What a [`Cursor`] comes to next depends only on its ray, the scene and the candidates that it
//! came to before. So a packet may find it: the closest hit of each ray, opaque or not, behind the
//! candidate that was last decided on. A ray that ignores a candidate is traced again from the
//! root, and passes the boxes before it.

use std::sync::Arc;

use crate::accel::cursor::Cursor;
use crate::accel::hit::{Candidate, HitKey};
use crate::accel::packet::{MAX_RAYS, MIN_RAYS, Packet};
use crate::accel::tlas::Tlas;
use crate::accel::trace_ray::TraceRay;

/// Finds the next hits of several cursors together. Its memory is kept for the next ones.
#[derive(Clone, Debug, Default)]
pub struct LookAhead {
    /// The structure that the cursors traverse. It is kept, as the next cursors most likely
    /// traverse it, too, and its reference count is shared by all threads.
    tlas: Option<Arc<Tlas>>,
    packet: Option<Box<Packet>>,
    /// By cursor, what its owner knows it by.
    owners: Vec<u32>,
    rays: Vec<TraceRay>,
    /// By cursor, the candidate behind which its next hit lies.
    behind: Vec<Option<HitKey>>,
}

impl LookAhead {
    /// Begins with cursors of one structure, about so many. Returns `false` where looking ahead is
    /// not worthwhile: for few cursors it only is if there were many before.
    #[inline]
    pub fn begin(&mut self, tlas: &Arc<Tlas>, cursors: usize) -> bool {
        let enough = cursors >= MIN_RAYS || cursors > 0 && self.packet.is_some();
        if !enough || !tlas.has_whole_primitives() || !tlas.suits_packets() {
            return false;
        }
        if self.tlas.as_ref().is_none_or(|known| !Arc::ptr_eq(known, tlas)) {
            self.tlas = Some(tlas.clone());
        }
        self.owners.clear();
        self.rays.clear();
        self.behind.clear();
        true
    }

    /// Adds a cursor, which traverses a structure, if that is the one and its next hit can be
    /// found.
    #[inline]
    pub fn add(&mut self, owner: u32, cursor: &Cursor, tlas: &Arc<Tlas>) {
        let is_known = self.tlas.as_ref().is_some_and(|known| Arc::ptr_eq(known, tlas));
        if let Some(behind) = cursor.behind().filter(|_| is_known) {
            self.owners.push(owner);
            self.rays.push(*cursor.trace());
            self.behind.push(behind);
        }
    }

    /// Finds the next hits of the cursors that were added, as far as that pays, and passes each to
    /// `take` with its owner, for [`Cursor::take_next_hit`].
    pub fn find(&mut self, mut take: impl FnMut(u32, Option<Candidate>)) {
        let Some(tlas) = &self.tlas else { return };
        let packet = self.packet.get_or_insert_default();
        let all = self.rays.chunks(MAX_RAYS).zip(self.behind.chunks(MAX_RAYS));
        for ((rays, behind), owners) in all.zip(self.owners.chunks(MAX_RAYS)) {
            let mut known = packet.find_next_hits(tlas, rays, behind);
            while known != 0 {
                let at = known.trailing_zeros() as usize;
                known &= known - 1;
                take(owners[at], packet.next_hit(tlas, at, rays[at].flags));
            }
        }
    }
}
