//! Rays that are traced together.
//!
//! Rays of neighbouring invocations mostly come to the same nodes. Up to [`MOST`] rays whose components
//! have the same signs go through a tree as one ray of intervals (`rows::Rows::around`): a node is opened
//! once for all of them, in an order that suits the nearest. Before it is, each ray tests its box, eight
//! rays at a time; where only a few meet it they go on by themselves. In a leaf those that meet it test its
//! primitives one ray after the other, as they would alone. So what is found is what each ray finds by
//! itself: the order in which primitives are tested changes nothing (see `cursor`).
//!
//! Where rays go apart that does not pay: after more steps than they would have taken alone, or after many
//! that each takes by itself, the rest is left to a [`Cursor`] each, and so are the next packets for a
//! while. So are rays that are not [ordinary](crate::geometry::Ray::is_ordinary), or start far from what
//! they reach.

mod rows;
mod walk;

use crate::accel::body::Name;
use crate::accel::cursor::{Candidate, Committed, Cursor, TraceRay};
use crate::accel::level::Level;
use crate::accel::node::{NodeRef, WIDTH};
use crate::accel::tlas::Tlas;
use crate::geometry::{Intersection, Precision, Surface};
use rows::{Rays, Row, Rows};
use walk::Walk;

/// So many rays go together at the most.
pub const MOST: usize = 64;

/// Fewer rays than that go each by itself.
const LEAST: usize = 8;

/// So many nodes and leaves a ray may be opened together before the rays go on by themselves.
const STEPS: u32 = 4;

/// And so many more by one ray alone, below what few rays meet: in random order rays take two and a half or
/// more, those of a tile hardly ever two.
const SINGLE_STEPS: u32 = 2;

/// Traces rays together where they go alike. Its memory is used again for the next ones.
///
/// ```
/// use anyhit::accel::{Blas, Geometry, GeometryData, GeometryFlags, Instance, Packet, RayFlags, Tlas, TraceRay};
/// use anyhit::geometry::Ray;
///
/// let data = GeometryData::Spheres { positions: vec![[0.0; 3]], radii: vec![1.0], indices: None };
/// let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)])?;
/// let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
/// let tlas = Tlas::new(vec![Instance::of(blas, identity)])?;
/// let down = |x: f32| Ray::new([x, 0.0, 3.0], [0.0, 0.0, -1.0]);
/// let trace = |x| TraceRay { ray: down(x), flags: RayFlags::default(), cull_mask: 0xFF, time: 0.0 };
/// let traces: Vec<_> = (0..64).map(|k| trace((k as f32 + 0.5) / 32.0)).collect();
/// let mut hits = Vec::new();
/// assert!(Packet::default().trace(&tlas, &traces, false, &mut hits));
/// // Those within the radius.
/// assert_eq!(hits.iter().flatten().count(), 32);
/// # Ok::<(), anyhit::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Packet {
    /// For rays that go by themselves.
    cursor: Cursor,
    levels: Vec<Level>,
    rays: Rays,
    world: Rows,
    rows: Rows,
    /// Of each ray: no hit behind it matters; a rounded t.
    limits: Row,
    /// A bit for each ray whose level is that of the instance before.
    stale: u64,
    /// A bit for each ray that has a hit.
    hit: u64,
    hits: [Found; MOST],
    stack: Vec<StackEntry>,
    /// How many more nodes and leaves may be opened.
    steps: u32,
    /// And by one ray alone.
    single_steps: u32,
    /// For how many packets rays go by themselves.
    apart: u32,
    /// How many times in a row packets did not pay.
    failed: u32,
    /// How many of the last rays went together with others to the end.
    went_together: u32,
}

/// The closest hit of a ray.
#[derive(Clone, Copy, Debug)]
struct Found {
    instance: u32,
    /// In the tree order of the instance's primitives.
    place: u32,
    intersection: Intersection,
}

impl Found {
    /// Memory for a hit.
    const IDLE: Self = Self {
        instance: 0,
        place: 0,
        intersection: Intersection { t: 0.0, attributes: [0.0; 2], surface: Surface::Aabb },
    };

    /// What it is a hit of.
    #[inline]
    fn candidate(&self, tlas: &Tlas) -> Candidate {
        let Self { instance, place, intersection } = *self;
        let Name { geometry, primitive } =
            tlas.instances()[instance as usize].blas.body().name_at(place as usize);
        Candidate { instance, geometry, primitive, intersection, opaque: true }
    }

    /// Whether it comes before another one, in the list of all hits, at the same t.
    #[cold]
    fn is_before(&self, other: &Self, tlas: &Tlas) -> bool {
        let [this, other] = [self, other].map(|one| Committed::opaque(one.candidate(tlas)));
        this.zip(other).is_some_and(|(this, other)| this.is_before(&other))
    }
}

/// A node or leaf that is still to be visited. The high half holds the bits of a lower bound of the t
/// at which it is entered, the low half its parent node and its slot there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct StackEntry(u64);

impl StackEntry {
    #[inline(always)]
    fn new(t_near: f32, node: NodeRef, slot: usize) -> Self {
        Self(u64::from(t_near.to_bits()) << 32 | (node.index() * WIDTH + slot) as u64)
    }

    #[inline(always)]
    fn t_near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn node_and_slot(self) -> (NodeRef, usize) {
        let at = self.0 as u32 as usize;
        (NodeRef::inner(at / WIDTH), at % WIDTH)
    }
}

impl Default for Packet {
    fn default() -> Self {
        Self {
            cursor: Cursor::idle(),
            levels: vec![Level::IDLE; MOST],
            rays: Rays::IDLE,
            world: Rows::IDLE,
            rows: Rows::IDLE,
            limits: Row::IDLE,
            stale: 0,
            hit: 0,
            hits: [Found::IDLE; MOST],
            stack: Vec::new(),
            steps: 0,
            single_steps: 0,
            apart: 0,
            failed: 0,
            went_together: 0,
        }
    }
}

impl Packet {
    /// Finds the closest hits of rays; the hit of each is what a [`Cursor`] finds for it. With
    /// `any_opaque_hit` whether there is one is right and which one is left open, as for
    /// [`Cursor::end_at_any_opaque_hit`]. Returns `false`, and does nothing, where a shader may have to
    /// decide about a candidate ([`Tlas::is_fully_opaque`]).
    pub fn trace(
        &mut self,
        tlas: &Tlas,
        traces: &[TraceRay],
        any_opaque_hit: bool,
        hits: &mut Vec<Option<Committed>>,
    ) -> bool {
        if !traces.iter().all(|trace| tlas.is_fully_opaque(trace.flags)) {
            return false;
        }
        hits.clear();
        hits.reserve(traces.len());
        self.went_together = 0;
        for traces in traces.chunks(MOST) {
            let alone = if self.is_worth_it(tlas, traces) {
                self.together(tlas, traces, any_opaque_hit)
            } else {
                u64::MAX
            };
            self.went_together +=
                traces.len() as u32 - (alone & (u64::MAX >> (MOST - traces.len()))).count_ones();
            for (at, trace) in traces.iter().enumerate() {
                hits.push(if alone >> at & 1 == 0 {
                    self.committed(tlas, at)
                } else {
                    self.one(tlas, trace, any_opaque_hit)
                });
            }
        }
        true
    }

    /// How many rays of the last [`Packet::trace`] went together with others to the end.
    pub fn went_together(&self) -> u32 {
        self.went_together
    }

    /// Puts children of a node on the stack, the nearest on top.
    #[inline(always)]
    fn push(&mut self, near: [f32; WIDTH], mut met: u32, node: NodeRef) {
        let bottom = self.stack.len();
        while met != 0 {
            let slot = met.trailing_zeros() as usize % WIDTH;
            met &= met - 1;
            self.stack.push(StackEntry::new(near[slot], node, slot));
            let top = &mut self.stack[bottom..];
            let mut at = top.len() - 1;
            while at > 0 && top[at - 1] < top[at] {
                top.swap(at - 1, at);
                at -= 1;
            }
        }
    }

    /// Whether it is not plain that each ray is better off by itself.
    #[inline]
    fn is_worth_it(&mut self, tlas: &Tlas, traces: &[TraceRay]) -> bool {
        let [first, ..] = traces else { return false };
        let alike = |trace: &TraceRay| trace.flags == first.flags && trace.cull_mask == first.cull_mask;
        // Below `Exact` what is hit may depend on which boxes are opened.
        let order_matters = tlas.precision() != Precision::Exact;
        if traces.len() < LEAST || tlas.moves() || order_matters || !traces.iter().all(alike) {
            return false;
        }
        if self.apart > 0 {
            self.apart -= 1;
            return false;
        }
        true
    }

    fn one(&mut self, tlas: &Tlas, trace: &TraceRay, any_opaque_hit: bool) -> Option<Committed> {
        self.cursor.reset(tlas, *trace);
        if any_opaque_hit {
            self.cursor.end_at_any_opaque_hit();
        }
        while self.cursor.proceed(tlas).is_some() {}
        self.cursor.committed().copied()
    }

    /// The hit of a ray that was traced with others.
    #[inline]
    fn committed(&self, tlas: &Tlas, at: usize) -> Option<Committed> {
        if self.hit >> at & 1 == 0 {
            return None;
        }
        Committed::opaque(self.hits[at].candidate(tlas))
    }

    /// Traces rays together, and says which must be traced by themselves.
    fn together(&mut self, tlas: &Tlas, traces: &[TraceRay], any_opaque_hit: bool) -> u64 {
        (self.steps, self.single_steps) = (STEPS * traces.len() as u32, SINGLE_STEPS * traces.len() as u32);
        let walk = Walk { packet: self, tlas, traces, any_opaque_hit, alone: 0 };
        let alone = tlas.processor().run(walk);
        if self.steps == 0 {
            self.failed = (self.failed + 1).min(6);
            self.apart = 1 << self.failed;
        } else {
            self.failed = 0;
        }
        alone
    }
}

#[cfg(test)]
mod tests;
