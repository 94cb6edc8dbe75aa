//! Rays that are traced together.
//!
//! Rays of neighbouring invocations mostly come to the same nodes. Up to [`MOST`] rays whose components
//! have the same signs go through a tree as one ray of intervals (`rows::Rows::around`): a node is opened
//! once for all of them, in an order that suits the nearest. Before it is, each ray tests its box, eight
//! rays at a time; where only a few meet it they go on by themselves. In a leaf those that meet it test its
//! primitives one ray after the other, as they would alone. So what is found is what each ray finds by
//! itself: the order in which primitives are tested changes nothing (see `cursor`).
//!
//! Where rays go apart that does not pay: after more steps than they would have taken alone the rest
//! is left to a [`Cursor`] each, and so are the next packets for a while. So are rays that are not
//! [ordinary](crate::geometry::Ray::is_ordinary), or start far from what they reach.

mod rows;

use crate::accel::body::{Body, Name};
use crate::accel::cursor::{Candidate, Committed, Cursor, TraceRay};
use crate::accel::level::Level;
use crate::accel::node::{Child, WIDTH};
use crate::accel::rules::{is_culled_by_face, is_culled_by_opacity, is_skipped, is_visible, presented};
use crate::accel::tlas::{Placed, Tlas};
use crate::accel::tree::Tree;
use crate::geometry::triangle::FourTested;
use crate::geometry::{DoubleRay, Intersection, Precision, Surface};
use crate::math::doubles::{Task, Vectors};
use crate::math::eight::TwoFours;
use rows::{Group, Rays, Row, Rows};

/// So many rays go together at the most.
pub const MOST: usize = 64;

/// Fewer rays than that go each by itself.
const LEAST: usize = 8;

/// So few rays go by themselves below a node that no others meet.
const FEW: u32 = 3;

/// So many nodes and leaves a ray may be opened together before the rays go on by themselves.
const STEPS: u32 = 4;

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
    stack: Vec<Open>,
    /// How many more nodes and leaves may be opened.
    steps: u32,
    /// For how many packets rays go by themselves.
    apart: u32,
    /// How many times in a row packets did not pay.
    failed: u32,
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

/// A part of a tree that is still to be visited: above where it is entered at the earliest, as bits,
/// below which child of which node it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Open(u64);

impl Open {
    #[inline(always)]
    fn new(entry: f32, node: Child, slot: usize) -> Self {
        Self(u64::from(entry.to_bits()) << 32 | (node.index() * WIDTH + slot) as u64)
    }

    #[inline(always)]
    fn entry(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn place(self) -> (Child, usize) {
        let at = self.0 as u32 as usize;
        (Child::inner(at / WIDTH), at % WIDTH)
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
            apart: 0,
            failed: 0,
        }
    }
}

impl Packet {
    /// Finds the closest hits of rays; the hit of each is what a [`Cursor`] finds for it. With
    /// `any_opaque_hit` whether there is one is right and which one is left open, as for
    /// [`Cursor::end_at_any_opaque_hit`]. Returns `false`, and does nothing, where a shader may have to
    /// decide about a candidate ([`Tlas::is_decided_without_shaders`]).
    pub fn trace(
        &mut self,
        tlas: &Tlas,
        traces: &[TraceRay],
        any_opaque_hit: bool,
        hits: &mut Vec<Option<Committed>>,
    ) -> bool {
        if !traces.iter().all(|trace| tlas.is_decided_without_shaders(trace.flags)) {
            return false;
        }
        hits.clear();
        hits.reserve(traces.len());
        for traces in traces.chunks(MOST) {
            let alone = if self.is_worth_it(tlas, traces) {
                self.together(tlas, traces, any_opaque_hit)
            } else {
                u64::MAX
            };
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

    /// Puts children of a node on the stack, the nearest on top.
    #[inline(always)]
    fn push(&mut self, near: [f32; WIDTH], mut met: u32, node: Child) {
        let bottom = self.stack.len();
        while met != 0 {
            let slot = met.trailing_zeros() as usize % WIDTH;
            met &= met - 1;
            self.stack.push(Open::new(near[slot], node, slot));
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
        self.steps = STEPS * traces.len() as u32;
        let walk = Walk { packet: self, tlas, traces, any_opaque_hit, alone: 0 };
        #[cfg(target_arch = "x86_64")]
        let alone = match tlas.simd() {
            Some(simd) => simd.apart(walk),
            None => TwoFours.apart(walk),
        };
        #[cfg(not(target_arch = "x86_64"))]
        let alone = TwoFours.apart(walk);
        if self.steps == 0 {
            self.failed = (self.failed + 1).min(6);
            self.apart = 1 << self.failed;
        } else {
            self.failed = 0;
        }
        alone
    }
}

/// A traversal with its arguments.
struct Walk<'a> {
    packet: &'a mut Packet,
    tlas: &'a Tlas,
    traces: &'a [TraceRay],
    any_opaque_hit: bool,
    /// Rays that do not go with the others.
    alone: u64,
}

impl Task for Walk<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<E: Vectors>(self, eights: E) -> u64 {
        self.together(eights)
    }
}

/// Some rays come to a leaf.
struct Reach<'w, 'a, 'i> {
    walk: &'w mut Walk<'a>,
    inside: &'i Inside<'i>,
    leaf: Child,
    rays: u64,
}

impl Task for Reach<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<E: Vectors>(self, eights: E) {
        self.walk.test(eights, self.inside, self.leaf, self.rays);
    }
}

/// Some rays come to an instance.
struct Enter<'w, 'a> {
    walk: &'w mut Walk<'a>,
    instance: u32,
    rays: u64,
}

impl Task for Enter<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<E: Vectors>(self, eights: E) {
        self.walk.enter(eights, self.instance, self.rays);
    }
}

// What operates on vectors is inlined into the function of a task: nothing of it stands in closures.
impl Walk<'_> {
    #[inline(always)]
    fn together<E: Vectors>(mut self, eights: E) -> u64 {
        let count = self.traces.len();
        let packet = &mut *self.packet;
        packet.hit = 0;
        packet.stack.clear();
        packet.limits = Row([-1.0; MOST]);
        for (limit, trace) in packet.limits.0.iter_mut().zip(self.traces) {
            // An infinite t would let boxes at infinity pass.
            *limit = trace.ray.t_max.min(f32::MAX);
        }
        let rays = packet.rays.take(eights, self.traces);
        self.leave_alone(!rays & (u64::MAX >> (MOST - count)));
        let instances = self.tlas.instances().len();
        if rays == 0 || instances == 0 {
            return self.alone;
        }
        match self.tlas.tree() {
            None => {
                for number in 0..instances {
                    eights.apart(Enter { walk: &mut self, instance: number as u32, rays });
                }
            }
            Some((tree, order)) => self.through_world(eights, tree, order, rays),
        }
        if self.packet.steps == 0 { u64::MAX } else { self.alone }
    }

    /// Lets rays go by themselves, later.
    #[inline(always)]
    fn leave_alone(&mut self, rays: u64) {
        self.alone |= rays;
        for at in bits(rays) {
            self.packet.limits.0[at] = -1.0;
        }
    }

    /// Visits the tree over the instances.
    #[inline(always)]
    fn through_world<E: Vectors>(&mut self, eights: E, tree: &Tree, order: &[u32], rays: u64) {
        let fit = self.packet.world.take_simple(eights, &self.packet.rays, tree.scale(), rays);
        self.leave_alone(rays & !fit);
        let mut rest = fit;
        while rest != 0 {
            let group = self.packet.world.first_group(rest);
            rest &= !group.rays;
            let root = tree.root();
            if root.is_leaf() {
                eights.apart(Enter { walk: self, instance: order[root.index()], rays: group.rays });
                continue;
            }
            self.visit(eights, &group, tree, &Instances(order));
        }
    }

    /// Visits the parts of a tree that rays meet, the nearest first: all of them together, and a few by
    /// themselves.
    #[inline(always)]
    fn visit<E: Vectors>(&mut self, eights: E, group: &Group, tree: &Tree, leaves: &impl Leaves) {
        if group.rays.count_ones() <= FEW {
            return self.visit_singly(eights, group, tree, tree.root(), leaves);
        }
        let base = self.packet.stack.len();
        let around = leaves.rows(self.packet).around(eights, &self.packet.rays, group);
        let slabs = around.slabs(eights);
        let mut limit = self.packet.limits.greatest(eights, group.rays);
        let mut inner = Some(tree.root());
        loop {
            if let Some(at) = inner.take() {
                let (near, met) = tree.node(at).entries(&slabs, around.limit(limit));
                self.packet.push(near, met, at);
            }
            if self.packet.stack.len() <= base {
                return;
            }
            let Some(open) = self.packet.stack.pop() else { return };
            if open.entry() > limit {
                continue;
            }
            if self.packet.steps == 0 {
                self.packet.stack.truncate(base);
                return;
            }
            self.packet.steps -= 1;
            let (at, slot) = open.place();
            let node = tree.node(at);
            let child = node.child(slot);
            let Packet { rays, limits, .. } = &*self.packet;
            let met = leaves.rows(self.packet).met(eights, rays, group, (node, slot), limits);
            if child.is_leaf() {
                leaves.reach(self, eights, child, met);
            } else if met.count_ones() <= FEW {
                self.visit_singly(eights, &Group { rays: met, ..*group }, tree, child, leaves);
            } else {
                inner = Some(child);
                continue;
            }
            limit = self.packet.limits.greatest(eights, group.rays);
        }
    }

    /// Visits the parts below a node that each of some rays meets by itself.
    #[inline(always)]
    fn visit_singly<E: Vectors>(
        &mut self,
        eights: E,
        group: &Group,
        tree: &Tree,
        root: Child,
        leaves: &impl Leaves,
    ) {
        let base = self.packet.stack.len();
        let mut rest = group.rays;
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize % MOST;
            rest &= rest - 1;
            let single = leaves.rows(self.packet).single(&self.packet.rays, ray, group);
            let slabs = single.slabs(eights);
            let mut inner = Some(root);
            loop {
                if let Some(at) = inner.take() {
                    let (near, met) = tree.node(at).entries(&slabs, single.limit(self.packet.limits.0[ray]));
                    self.packet.push(near, met, at);
                }
                if self.packet.stack.len() <= base {
                    break;
                }
                let Some(open) = self.packet.stack.pop() else { break };
                if open.entry() > self.packet.limits.0[ray] {
                    continue;
                }
                let (at, slot) = open.place();
                let child = tree.node(at).child(slot);
                if child.is_leaf() {
                    leaves.reach(self, eights, child, 1 << ray);
                } else {
                    inner = Some(child);
                }
            }
        }
    }

    /// Takes rays into an instance.
    #[inline(always)]
    fn enter<E: Vectors>(&mut self, eights: E, number: u32, rays: u64) {
        let instance = &self.tlas.instances()[number as usize];
        let TraceRay { flags, cull_mask, .. } = self.traces[0];
        if !is_visible(instance.mask, cull_mask)
            || instance.blas.kind().is_some_and(|kind| is_skipped(flags, kind))
            || is_culled_by_opacity(flags, true)
        {
            return;
        }
        let body = instance.blas.body();
        let placed = self.tlas.transform(number);
        let Packet { rays: all, rows, .. } = &mut *self.packet;
        let fit = match (body.tree(), placed) {
            (None, _) => rays,
            (Some(tree), Placed::InWorld) => rows.take_simple(eights, all, tree.scale(), rays),
            (Some(tree), Placed::Still(transform)) => {
                rows.take_rough(eights, all, transform, tree.scale(), rays)
            }
            (Some(_), Placed::Moving) => 0,
        };
        self.leave_alone(rays & !fit);
        self.packet.stale = fit;
        let inside = Inside { instance: number, body, in_world: matches!(placed, Placed::InWorld) };
        let Some(tree) = body.tree().filter(|tree| !tree.root().is_leaf()) else {
            for leaf in body.leaves() {
                eights.apart(Reach { walk: self, inside: &inside, leaf, rays: fit });
            }
            return;
        };
        let mut rest = fit;
        while rest != 0 {
            let group = self.packet.rows.first_group(rest);
            rest &= !group.rays;
            self.visit(eights, &group, tree, &inside);
        }
    }

    /// Tests the primitives of a leaf for some rays.
    #[inline(always)]
    fn test<E: Vectors>(&mut self, eights: E, inside: &Inside, leaf: Child, mut rays: u64) {
        let (tlas, traces, body) = (self.tlas, self.traces, inside.body);
        let precision = tlas.precision();
        let whole = body.tests_leaves(precision);
        while rays != 0 {
            let at = rays.trailing_zeros() as usize % MOST;
            rays &= rays - 1;
            let trace = &traces[at];
            let mut tested = FourTested::MISSED;
            let mut rest = if whole {
                let ray = if inside.in_world {
                    DoubleRay::ordinary(&trace.ray)
                } else {
                    DoubleRay::of(self.level(inside, at).object_ray(tlas, trace))
                };
                tested = body.tested(eights, leaf, &ray, self.packet.limits.0[at]);
                tested.met() & body.every(leaf)
            } else {
                self.level(inside, at).met(tlas, body, leaf, trace)
            };
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let found = match tested.hit(lane) {
                    None => {
                        let ray = self.level(inside, at).object_ray(tlas, trace);
                        body.intersect((leaf, lane), ray, 0.0, precision)
                    }
                    found => found,
                };
                if let Some(found) = found.filter(|found| found.t <= self.packet.limits.0[at]) {
                    self.take(inside, body.place(leaf, lane), at, found);
                    if self.any_opaque_hit && self.packet.hit >> at & 1 != 0 {
                        self.packet.limits.0[at] = -1.0;
                        break;
                    }
                }
            }
        }
    }

    /// What else a ray's tests need in an instance.
    #[inline(always)]
    fn level(&mut self, inside: &Inside, at: usize) -> &mut Level {
        let level = &mut self.packet.levels[at];
        if self.packet.stale >> at & 1 != 0 {
            self.packet.stale &= !(1 << at);
            level.arrive(self.tlas, inside.instance, inside.body, &self.traces[at]);
        }
        level
    }

    /// Takes an opaque hit where it is the closest so far.
    #[inline(always)]
    fn take(&mut self, inside: &Inside, place: usize, at: usize, found: Intersection) {
        let instance = &self.tlas.instances()[inside.instance as usize];
        let flags = self.traces[0].flags;
        let intersection = Intersection { surface: presented(found.surface, instance.flags), ..found };
        if is_culled_by_face(flags, instance.flags, intersection.surface) {
            return;
        }
        let Packet { hits, hit, limits, .. } = &mut *self.packet;
        let found = Found { instance: inside.instance, place: place as u32, intersection };
        if found.intersection.t == limits.0[at]
            && *hit >> at & 1 != 0
            && !found.is_before(&hits[at], self.tlas)
        {
            return;
        }
        *hit |= 1 << at;
        limits.0[at] = found.intersection.t;
        hits[at] = found;
    }
}

/// An instance that rays are in.
struct Inside<'a> {
    instance: u32,
    body: &'a Body,
    /// Whether its space is the world's.
    in_world: bool,
}

/// What stands in the leaves of a tree.
trait Leaves {
    /// The rays as its boxes see them.
    fn rows<'p>(&self, packet: &'p Packet) -> &'p Rows;

    /// Some rays come to a leaf.
    fn reach<E: Vectors>(&self, walk: &mut Walk, eights: E, leaf: Child, rays: u64);
}

/// Instances, in the order of the tree over them.
struct Instances<'a>(&'a [u32]);

impl Leaves for Instances<'_> {
    #[inline(always)]
    fn rows<'p>(&self, packet: &'p Packet) -> &'p Rows {
        &packet.world
    }

    #[inline(always)]
    fn reach<E: Vectors>(&self, walk: &mut Walk, eights: E, leaf: Child, rays: u64) {
        if rays != 0 {
            eights.apart(Enter { walk, instance: self.0[leaf.index()], rays });
        }
    }
}

impl Leaves for Inside<'_> {
    #[inline(always)]
    fn rows<'p>(&self, packet: &'p Packet) -> &'p Rows {
        &packet.rows
    }

    #[inline(always)]
    fn reach<E: Vectors>(&self, walk: &mut Walk, eights: E, leaf: Child, rays: u64) {
        if rays != 0 {
            eights.apart(Reach { walk, inside: self, leaf, rays });
        }
    }
}

/// The numbers of the bits that are set.
#[inline(always)]
fn bits(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let at = set.trailing_zeros() as usize % MOST;
        let found = (set != 0).then_some(at);
        set &= set.wrapping_sub(1);
        found
    })
}

#[cfg(test)]
mod tests;
