//! Ray packets: coherent rays that traverse the BVH together.
//!
//! Rays of neighbouring invocations mostly visit the same nodes. Up to [`MAX_RAYS`] rays whose
//! direction signs agree traverse a tree as one frustum (interval arithmetic,
//! `ray_soa::RaySoA::frustum`): a node is opened once for all of them, in the order of the
//! frustum's entries. Before it is opened each ray tests its box, eight rays at a time; if only a
//! few rays hit it they continue singly. In a leaf the rays that hit it test its primitives one
//! after the other, as single rays do. So each ray finds the same hit as it would singly: the order
//! in which primitives are tested does not matter (see `cursor`).
//!
//! This does not pay for incoherent rays. A packet that takes more steps than its rays would take
//! singly is given up: its rays are traced by a [`Cursor`] each, and so are those of the next few
//! packets. Rays that are not [well scaled](crate::geometry::Ray::is_well_scaled), or start far
//! from the geometry, are traced by a cursor too.

mod ray_soa;
mod traversal;
mod turns;

use ray_soa::{PerRay, RaySoA, WorldRays};
use traversal::PacketTraversal;
use turns::{Turns, WAYS};

use crate::accel::cursor::Cursor;
use crate::accel::flags::RayFlags;
use crate::accel::hit::{Candidate, Committed, HitKey};
use crate::accel::instance_ray::InstanceRay;
use crate::accel::node::{NodeRef, WIDTH};
use crate::accel::primitive_numbers::GeomPrim;
use crate::accel::rules::is_opaque;
use crate::accel::tlas::Tlas;
use crate::accel::trace_ray::TraceRay;
use crate::accel::traversal_stack::Stack;
use crate::geometry::{Intersection, Surface};

/// The largest number of rays in a packet.
pub const MAX_RAYS: usize = 64;

/// Fewer rays than this are traced singly.
pub(super) const MIN_RAYS: usize = 8;

/// The nodes and leaves that a packet may open for each of its rays before it is given up.
const STEPS_PER_RAY: u32 = 4;

/// The rays that a packet is counted as, at least, when it finds next hits: those that go on,
/// behind a candidate that they ignored, reach as many nodes as the tile that they are left of.
const MIN_STEP_RAYS: usize = 32;

/// The nodes and leaves that single rays of a packet may visit, for each of its rays: rays in
/// random order take two and a half or more, those of a tile hardly ever two.
const SINGLE_STEPS_PER_RAY: u32 = 2;

/// Traces coherent rays together. Its buffers are kept for the next call.
///
/// ```
/// use anyhit_engine::accel::{
///     Blas, Geometry, GeometryData, GeometryFlags, Packet, RayFlags, Tlas, TlasInstance, TraceRay,
/// };
/// use anyhit_engine::geometry::Ray;
///
/// let data = GeometryData::Spheres { positions: vec![[0.0; 3]], radii: vec![1.0], indices: None };
/// let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)])?;
/// let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
/// let tlas = Tlas::new(vec![TlasInstance::of(blas, identity)])?;
/// let down = |x: f32| Ray::new([x, 0.0, 3.0], [0.0, 0.0, -1.0]);
/// let flags = RayFlags::default();
/// let trace = |x| TraceRay { ray: down(x), flags, cull_mask: 0xFF, time: 0.0 };
/// let traces: Vec<_> = (0..64).map(|k| trace((k as f32 + 0.5) / 32.0)).collect();
/// let mut hits = Vec::new();
/// assert!(Packet::default().trace(&tlas, &traces, false, &mut hits));
/// // The rays within the radius hit the sphere.
/// assert_eq!(hits.iter().flatten().count(), 32);
/// # Ok::<(), anyhit::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Packet {
    /// The cursor for rays that are traced singly.
    cursor: Cursor,
    instance_rays: Vec<InstanceRay>,
    /// The stacks of rays that take turns.
    turn_stacks: [Stack; WAYS],
    rays: WorldRays,
    world_soa: RaySoA,
    instance_soa: RaySoA,
    /// For each ray the rounded t behind which no hit matters.
    limits: PerRay,
    /// A mask of the rays whose entry of `instance_rays` is not yet made for the current instance.
    stale: u64,
    /// A mask of the rays that have a hit.
    hit: u64,
    hits: [PacketHit; MAX_RAYS],
    stack: Vec<StackEntry>,
    /// The number of nodes and leaves that may still be opened.
    steps: u32,
    /// The number of nodes and leaves that single rays may still visit.
    single_steps: u32,
    /// The number of packets that are still to be traced singly.
    packet_cooldown: u32,
    /// The number of packets in a row that were given up.
    failed_packets: u32,
    /// The number of rays of the last call that the packets traced to the end.
    traced_together: u32,
}

/// The closest hit of a ray so far.
#[derive(Clone, Copy, Debug)]
struct PacketHit {
    instance: u32,
    /// The index of the primitive in the tree order of its BLAS.
    ordered_index: u32,
    intersection: Intersection,
}

impl PacketHit {
    /// Placeholder value.
    const EMPTY: Self = Self {
        instance: 0,
        ordered_index: 0,
        intersection: Intersection { t: 0.0, attributes: [0.0; 2], surface: Surface::Aabb },
    };

    /// The hit as a candidate.
    #[inline]
    fn candidate(&self, tlas: &Tlas) -> Candidate {
        let Self { instance, ordered_index, intersection } = *self;
        let GeomPrim { geometry, primitive } =
            tlas.instances()[instance as usize].blas.built().geom_prim_at(ordered_index as usize);
        Candidate { instance, geometry, primitive, intersection, opaque: true }
    }

    /// The key by which hits are ordered.
    #[inline(never)]
    fn key(&self, tlas: &Tlas) -> HitKey {
        self.candidate(tlas).key(self.intersection.t)
    }

    /// Whether it precedes another hit at the same t in the order of hits.
    #[cold]
    fn is_before(&self, other: &Self, tlas: &Tlas) -> bool {
        self.key(tlas) < other.key(tlas)
    }
}

/// A node or leaf that is still to be visited. The high half holds the bits of a lower bound of the
/// t at which it is entered, the low half its parent node and its slot there.
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
            cursor: Cursor::empty(),
            instance_rays: vec![InstanceRay::EMPTY; MAX_RAYS],
            turn_stacks: [const { Stack::EMPTY }; WAYS],
            rays: WorldRays::EMPTY,
            world_soa: RaySoA::EMPTY,
            instance_soa: RaySoA::EMPTY,
            limits: PerRay::EMPTY,
            stale: 0,
            hit: 0,
            hits: [PacketHit::EMPTY; MAX_RAYS],
            stack: Vec::new(),
            steps: 0,
            single_steps: 0,
            packet_cooldown: 0,
            failed_packets: 0,
            traced_together: 0,
        }
    }
}

impl Packet {
    /// Finds the closest hit of each ray, the one that a [`Cursor`] finds. With `any_opaque_hit` it
    /// finds any hit instead of the closest (occlusion), as [`Cursor::end_at_any_opaque_hit`].
    /// Returns `false`, and does nothing, where a shader may have to decide about a candidate
    /// ([`Tlas::is_fully_opaque`]).
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
        self.traced_together = 0;
        for traces in traces.chunks(MAX_RAYS) {
            let all = u64::MAX >> (MAX_RAYS - traces.len());
            let mut single_ray_mask = if self.is_worthwhile(tlas, traces) {
                self.trace_together(tlas, traces, &[], traces.len(), any_opaque_hit) & all
            } else {
                all
            };
            self.traced_together += (all & !single_ray_mask).count_ones();
            if single_ray_mask.count_ones() > 1 && turns::pays(tlas) {
                let turns = Turns { packet: self, tlas, traces, rays: single_ray_mask, any_opaque_hit };
                single_ray_mask = tlas.cpu_tier().run(turns);
            }
            for (at, trace) in traces.iter().enumerate() {
                hits.push(if single_ray_mask >> at & 1 == 0 {
                    self.committed(tlas, at)
                } else {
                    self.trace_single(tlas, trace, any_opaque_hit)
                });
            }
        }
        true
    }

    /// Finds the next hit of each of up to [`MAX_RAYS`] rays in the order of hits, opaque or not:
    /// behind that of `behind` where this names one. Returns a mask of the rays whose next hit is
    /// known; none where tracing them together does not pay.
    pub(super) fn find_next_hits(
        &mut self,
        tlas: &Tlas,
        traces: &[TraceRay],
        behind: &[Option<HitKey>],
    ) -> u64 {
        let by_opacity = (RayFlags::CULL_OPAQUE | RayFlags::CULL_NO_OPAQUE).0;
        let [first, ..] = traces else { return 0 };
        let culls = first.flags.0 & by_opacity != 0;
        if culls || !tlas.has_whole_primitives() || !tlas.suits_packets() || !are_alike(traces) {
            return 0;
        }
        let single_ray_mask = if traces.len() < MIN_RAYS {
            self.trace_few(tlas, traces, behind)
        } else if self.has_cooled_down() {
            self.trace_together(tlas, traces, behind, traces.len().max(MIN_STEP_RAYS), false)
        } else {
            return 0;
        };
        !single_ray_mask & (u64::MAX >> (MAX_RAYS - traces.len()))
    }

    /// The next hit that [`Packet::find_next_hits`] has found for a ray; `None` where there is
    /// none.
    #[inline]
    pub(super) fn next_hit(&self, tlas: &Tlas, at: usize, flags: RayFlags) -> Option<Candidate> {
        if self.hit >> at & 1 == 0 {
            return None;
        }
        let PacketHit { instance: number, ordered_index, intersection } = self.hits[at];
        let instance = &tlas.instances()[number as usize];
        let built = instance.blas.built();
        let GeomPrim { geometry, primitive } = built.geom_prim_at(ordered_index as usize);
        // No geometry has a micromap.
        let geometry_flags = match built.common_flags() {
            Some(flags) => flags,
            None => instance.blas.geometries()[geometry as usize].flags,
        };
        let opaque = is_opaque(flags, instance.flags, geometry_flags);
        Some(Candidate { instance: number, geometry, primitive, intersection, opaque })
    }

    /// The number of rays of the last [`Packet::trace`] that were traced as packets to the end.
    pub fn traced_together(&self) -> u32 {
        self.traced_together
    }

    /// Pushes the children of a node that `maybe_hit` names, the nearest on top.
    #[inline(always)]
    fn push(&mut self, near: [f32; WIDTH], mut maybe_hit: u32, node: NodeRef) {
        let bottom = self.stack.len();
        while maybe_hit != 0 {
            let slot = maybe_hit.trailing_zeros() as usize % WIDTH;
            maybe_hit &= maybe_hit - 1;
            self.stack.push(StackEntry::new(near[slot], node, slot));
            let top = &mut self.stack[bottom..];
            let mut at = top.len() - 1;
            while at > 0 && top[at - 1] < top[at] {
                top.swap(at - 1, at);
                at -= 1;
            }
        }
    }

    /// Whether tracing the rays as a packet may be faster than tracing them singly.
    #[inline]
    fn is_worthwhile(&mut self, tlas: &Tlas, traces: &[TraceRay]) -> bool {
        traces.len() >= MIN_RAYS && tlas.suits_packets() && are_alike(traces) && self.has_cooled_down()
    }

    /// Whether packets are tried again after some that were given up.
    #[inline]
    fn has_cooled_down(&mut self) -> bool {
        let has_cooled_down = self.packet_cooldown == 0;
        self.packet_cooldown = self.packet_cooldown.saturating_sub(1);
        has_cooled_down
    }

    fn trace_single(&mut self, tlas: &Tlas, trace: &TraceRay, any_opaque_hit: bool) -> Option<Committed> {
        self.cursor.trace_opaque(tlas, trace, any_opaque_hit).copied()
    }

    /// The hit of a ray that was traced in the packet.
    #[inline]
    fn committed(&self, tlas: &Tlas, at: usize) -> Option<Committed> {
        if self.hit >> at & 1 == 0 {
            return None;
        }
        Committed::opaque(self.hits[at].candidate(tlas))
    }

    /// Traces a packet, which may take as many steps as `step_rays` rays; returns a mask of the
    /// rays that must be traced singly.
    fn trace_together(
        &mut self,
        tlas: &Tlas,
        traces: &[TraceRay],
        behind: &[Option<HitKey>],
        step_rays: usize,
        any_opaque_hit: bool,
    ) -> u64 {
        (self.steps, self.single_steps) =
            (STEPS_PER_RAY * step_rays as u32, SINGLE_STEPS_PER_RAY * step_rays as u32);
        let single_ray_mask = self.run(tlas, traces, behind, any_opaque_hit);
        if self.steps == 0 {
            self.failed_packets = (self.failed_packets + 1).min(6);
            self.packet_cooldown = 1 << self.failed_packets;
        } else {
            self.failed_packets = 0;
        }
        single_ray_mask
    }

    /// Traces a few rays to their ends, mostly singly; returns a mask of those for which a packet
    /// is not exact enough.
    fn trace_few(&mut self, tlas: &Tlas, traces: &[TraceRay], behind: &[Option<HitKey>]) -> u64 {
        (self.steps, self.single_steps) = (u32::MAX, u32::MAX);
        self.run(tlas, traces, behind, false)
    }

    /// Traces rays with the steps that they may take; returns a mask of those that must be traced
    /// singly.
    fn run(
        &mut self,
        tlas: &Tlas,
        traces: &[TraceRay],
        behind: &[Option<HitKey>],
        any_opaque_hit: bool,
    ) -> u64 {
        let traversal =
            PacketTraversal { packet: self, tlas, traces, any_opaque_hit, behind, single_ray_mask: 0 };
        tlas.cpu_tier().run(traversal)
    }
}

/// Whether rays, of which there is at least one, share their flags and cull masks.
#[inline]
fn are_alike(traces: &[TraceRay]) -> bool {
    let [first, ..] = traces else { return false };
    traces.iter().all(|trace| trace.flags == first.flags && trace.cull_mask == first.cull_mask)
}

#[cfg(test)]
mod tests;
