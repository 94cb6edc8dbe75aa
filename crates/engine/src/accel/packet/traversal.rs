//! The BVH traversal of a packet: through the tree over the instances and the tree of each
//! instance.

use crate::accel::built_blas::{BuiltBlas, LeafRay};
use crate::accel::hit::HitKey;
use crate::accel::instance_ray::InstanceRay;
use crate::accel::node::NodeRef;
use crate::accel::packet::ray_soa::{OctantGroup, PerRay, RaySoA};
use crate::accel::packet::{MAX_RAYS, Packet, PacketHit};
use crate::accel::rules::{apply_flip_facing, is_culled_by_face};
use crate::accel::tlas::{InstanceTransform, Tlas};
use crate::accel::trace_ray::TraceRay;
use crate::accel::wide_bvh::WideBvh;
use crate::geometry::{DoubleRay, Intersection, Intersection4, ObjectRay};
use crate::math::f32x8::F32x8Ops;
use crate::math::f64x4::F64x4Ops;
use crate::math::lane_ops::{LaneOps, LaneTask};

/// Up to this many rays leave the packet below a node that no other ray hits, and traverse it
/// singly.
const MAX_SINGLE_RAYS: u32 = 3;

/// The traversal of a packet, with its arguments.
pub(super) struct PacketTraversal<'a> {
    pub packet: &'a mut Packet,
    pub tlas: &'a Tlas,
    pub traces: &'a [TraceRay],
    pub any_opaque_hit: bool,
    /// For each ray the hit behind which its hits count, if only those do; may be empty.
    pub behind: &'a [Option<HitKey>],
    /// A mask of the rays that must be traced singly.
    pub single_ray_mask: u64,
}

impl LaneTask for PacketTraversal<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<E: LaneOps>(self, simd: E) -> u64 {
        self.traverse(simd)
    }
}

/// Tests the primitives of a leaf for some rays.
struct LeafTask<'w, 'a, 'i> {
    traversal: &'w mut PacketTraversal<'a>,
    context: &'i InstanceContext<'i>,
    leaf: NodeRef,
    rays: u64,
}

impl LaneTask for LeafTask<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<E: LaneOps>(self, simd: E) {
        self.traversal.intersect_primitives(simd, self.context, self.leaf, self.rays);
    }
}

/// Traverses an instance with some rays.
struct InstanceTask<'w, 'a> {
    traversal: &'w mut PacketTraversal<'a>,
    instance: u32,
    rays: u64,
}

impl LaneTask for InstanceTask<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<E: LaneOps>(self, simd: E) {
        self.traversal.enter_instance(simd, self.instance, self.rays);
    }
}

// Everything that operates on vectors is inlined into the function of a task; closures would not
// be.
impl PacketTraversal<'_> {
    #[inline(always)]
    fn traverse<E: LaneOps>(mut self, simd: E) -> u64 {
        let count = self.traces.len();
        let packet = &mut *self.packet;
        packet.hit = 0;
        packet.stack.clear();
        packet.limits = PerRay([-1.0; MAX_RAYS]);
        for (limit, trace) in packet.limits.0.iter_mut().zip(self.traces) {
            // An infinite t would let boxes at infinity pass.
            *limit = trace.ray.t_max.min(f32::MAX);
        }
        let rays = packet.rays.take(simd, self.traces);
        for (at, behind) in self.behind.iter().enumerate() {
            if let Some(behind) = behind {
                packet.rays.skip_boxes_before(at, behind.t());
            }
        }
        self.leave_to_single_rays(!rays & (u64::MAX >> (MAX_RAYS - count)));
        let instances = self.tlas.instances().len();
        if rays == 0 || instances == 0 {
            return self.single_ray_mask;
        }
        match self.tlas.bvh() {
            None => {
                for number in 0..instances {
                    simd.dispatch(InstanceTask { traversal: &mut self, instance: number as u32, rays });
                }
            }
            Some((bvh, order)) => self.traverse_tlas(simd, bvh, order, rays),
        }
        if self.packet.steps == 0 { u64::MAX } else { self.single_ray_mask }
    }

    /// Leaves rays to be traced singly, later.
    #[inline(always)]
    fn leave_to_single_rays(&mut self, rays: u64) {
        self.single_ray_mask |= rays;
        for at in bits(rays) {
            self.packet.limits.0[at] = -1.0;
        }
    }

    /// Traverses the tree over the instances.
    #[inline(always)]
    fn traverse_tlas<E: LaneOps>(&mut self, simd: E, bvh: &WideBvh, order: &[u32], rays: u64) {
        let prepared = self.packet.world_soa.take_world_space(simd, &self.packet.rays, bvh.scale(), rays);
        self.leave_to_single_rays(rays & !prepared);
        let mut rest = prepared;
        while rest != 0 {
            let group = self.packet.world_soa.first_group(rest);
            rest &= !group.rays;
            let root = bvh.root();
            if root.is_leaf() {
                simd.dispatch(InstanceTask {
                    traversal: self,
                    instance: order[root.index()],
                    rays: group.rays,
                });
                continue;
            }
            self.traverse_bvh(simd, &group, bvh, &TlasLeaves(order));
        }
    }

    /// Traverses a tree with a group of rays, the nearest nodes first; below nodes that at most
    /// [`MAX_SINGLE_RAYS`] of them hit these go singly.
    #[inline(always)]
    fn traverse_bvh<E: LaneOps>(
        &mut self,
        simd: E,
        group: &OctantGroup,
        bvh: &WideBvh,
        leaves: &impl LeafVisitor,
    ) {
        if group.rays.count_ones() <= MAX_SINGLE_RAYS {
            return self.traverse_singly(simd, group, bvh, bvh.root(), leaves);
        }
        let base = self.packet.stack.len();
        let frustum = leaves.ray_soa(self.packet).frustum(simd, &self.packet.rays, group);
        let slabs = frustum.slabs(simd);
        let mut limit = self.packet.limits.max_over(simd, group.rays);
        let mut inner = Some(bvh.root());
        loop {
            if let Some(at) = inner.take() {
                let limits = F32x8Ops::splat(simd, frustum.limit(limit).0);
                let (near, maybe_hit) = bvh.node(at).intersect(&slabs, limits);
                self.packet.push(near, maybe_hit, at);
            }
            if self.packet.stack.len() <= base {
                return;
            }
            let Some(entry) = self.packet.stack.pop() else { return };
            if entry.t_near() > limit {
                continue;
            }
            if self.packet.steps == 0 {
                self.packet.stack.truncate(base);
                return;
            }
            self.packet.steps -= 1;
            let (at, slot) = entry.node_and_slot();
            let node = bvh.node(at);
            let child = node.child(slot);
            let Packet { rays, limits, .. } = &*self.packet;
            let maybe_hit = leaves.ray_soa(self.packet).maybe_hit_mask(simd, rays, group, node, slot, limits);
            if child.is_leaf() {
                leaves.visit_leaf(self, simd, child, maybe_hit);
            } else if maybe_hit.count_ones() <= MAX_SINGLE_RAYS {
                self.traverse_singly(simd, &OctantGroup { rays: maybe_hit, ..*group }, bvh, child, leaves);
            } else {
                inner = Some(child);
                continue;
            }
            limit = self.packet.limits.max_over(simd, group.rays);
        }
    }

    /// Traverses the subtree below a node with each of some rays singly.
    #[inline(always)]
    fn traverse_singly<E: LaneOps>(
        &mut self,
        simd: E,
        group: &OctantGroup,
        bvh: &WideBvh,
        root: NodeRef,
        leaves: &impl LeafVisitor,
    ) {
        let base = self.packet.stack.len();
        let mut rest = group.rays;
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize % MAX_RAYS;
            rest &= rest - 1;
            let single = leaves.ray_soa(self.packet).single(&self.packet.rays, ray, group);
            let slabs = single.slabs(simd);
            let mut inner = Some(root);
            loop {
                if let Some(at) = inner.take() {
                    let limit = F32x8Ops::splat(simd, single.limit(self.packet.limits.0[ray]).0);
                    let (near, maybe_hit) = bvh.node(at).intersect(&slabs, limit);
                    self.packet.push(near, maybe_hit, at);
                }
                if self.packet.stack.len() <= base {
                    break;
                }
                let Some(entry) = self.packet.stack.pop() else { break };
                if entry.t_near() > self.packet.limits.0[ray] {
                    continue;
                }
                if self.packet.single_steps == 0 || self.packet.steps == 0 {
                    self.packet.steps = 0;
                    self.packet.stack.truncate(base);
                    return;
                }
                self.packet.single_steps -= 1;
                let (at, slot) = entry.node_and_slot();
                let child = bvh.node(at).child(slot);
                if child.is_leaf() {
                    leaves.visit_leaf(self, simd, child, 1 << ray);
                } else {
                    inner = Some(child);
                }
            }
        }
    }

    /// Traverses the tree of an instance with some rays.
    #[inline(always)]
    fn enter_instance<E: LaneOps>(&mut self, simd: E, number: u32, rays: u64) {
        let instance = &self.tlas.instances()[number as usize];
        let TraceRay { flags, cull_mask, .. } = self.traces[0];
        if instance.is_passed_by(flags, cull_mask) {
            return;
        }
        let built = instance.blas.built();
        let instance_transform = self.tlas.transform(number);
        let Packet { rays: all, instance_soa, .. } = &mut *self.packet;
        let prepared = match (built.bvh(), instance_transform) {
            (None, _) => rays,
            (Some(bvh), InstanceTransform::Identity) => {
                instance_soa.take_world_space(simd, all, bvh.scale(), rays)
            }
            (Some(bvh), InstanceTransform::Static(transform)) => {
                instance_soa.take_approximate(simd, all, transform, bvh.scale(), rays)
            }
            (Some(_), InstanceTransform::Moving) => 0,
        };
        self.leave_to_single_rays(rays & !prepared);
        self.packet.stale = prepared;
        let context = InstanceContext { instance: number, built };
        let Some(bvh) = built.bvh().filter(|bvh| !bvh.root().is_leaf()) else {
            for leaf in built.leaves() {
                simd.dispatch(LeafTask { traversal: self, context: &context, leaf, rays: prepared });
            }
            return;
        };
        let mut rest = prepared;
        while rest != 0 {
            let group = self.packet.instance_soa.first_group(rest);
            rest &= !group.rays;
            self.traverse_bvh(simd, &group, bvh, &context);
        }
    }

    /// Tests the primitives of a leaf for some rays.
    #[inline(always)]
    fn intersect_primitives<E: LaneOps>(
        &mut self,
        simd: E,
        context: &InstanceContext,
        leaf: NodeRef,
        mut rays: u64,
    ) {
        let (tlas, traces, built) = (self.tlas, self.traces, context.built);
        let precision = tlas.precision();
        let tests_whole_leaves = built.tests_whole_leaves(precision);
        while rays != 0 {
            let at = rays.trailing_zeros() as usize % MAX_RAYS;
            rays &= rays - 1;
            let trace = &traces[at];
            let mut leaf_hits = Intersection4::MISSED;
            let mut rest = if tests_whole_leaves {
                let limit = self.packet.limits.0[at];
                leaf_hits = built.intersect_leaf(
                    simd,
                    leaf,
                    &mut PacketLeafRay { traversal: self, context, at },
                    limit,
                );
                leaf_hits.maybe_hit_mask() & built.full_mask(leaf)
            } else {
                self.instance_ray(context, at).maybe_hit_mask::<E, false>(simd, tlas, built, leaf, trace)
            };
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let found = match leaf_hits.hit(lane) {
                    None => {
                        let ray = self.instance_ray(context, at).object_ray(tlas, trace);
                        built.intersect(leaf, lane, ray, 0.0, precision)
                    }
                    found => found,
                };
                if let Some(found) = found.filter(|found| found.t <= self.packet.limits.0[at]) {
                    self.record_hit(context, built.ordered_index(leaf, lane), at, found);
                    if self.any_opaque_hit && self.packet.hit >> at & 1 != 0 {
                        self.packet.limits.0[at] = -1.0;
                        break;
                    }
                }
            }
        }
    }

    /// The state of a ray in an instance, which its tests of primitives need.
    #[inline(always)]
    fn instance_ray(&mut self, context: &InstanceContext, at: usize) -> &mut InstanceRay {
        let instance_ray = &mut self.packet.instance_rays[at];
        if self.packet.stale >> at & 1 != 0 {
            self.packet.stale &= !(1 << at);
            instance_ray.enter_with_packet(self.tlas, context.instance, context.built, &self.traces[at]);
        }
        instance_ray
    }

    /// Whether a hit is the one behind which those of its ray count, or comes before it.
    #[inline(always)]
    fn is_passed(&self, at: usize, found: &PacketHit) -> bool {
        let Some(Some(behind)) = self.behind.get(at) else { return false };
        found.intersection.t <= behind.t() && found.key(self.tlas) <= *behind
    }

    /// Records a hit if it is the closest so far.
    #[inline(always)]
    fn record_hit(
        &mut self,
        context: &InstanceContext,
        ordered_index: usize,
        at: usize,
        found: Intersection,
    ) {
        let instance = &self.tlas.instances()[context.instance as usize];
        let flags = self.traces[0].flags;
        let intersection =
            Intersection { surface: apply_flip_facing(found.surface, instance.flags), ..found };
        if is_culled_by_face(flags, instance.flags, intersection.surface) {
            return;
        }
        let found =
            PacketHit { instance: context.instance, ordered_index: ordered_index as u32, intersection };
        if self.is_passed(at, &found) {
            return;
        }
        let Packet { hits, hit, limits, .. } = &mut *self.packet;
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

/// One ray of the packet in an instance, as the tests of whole leaves take it.
struct PacketLeafRay<'a, 'b, 'c> {
    traversal: &'a mut PacketTraversal<'b>,
    context: &'a InstanceContext<'c>,
    at: usize,
}

impl LeafRay for PacketLeafRay<'_, '_, '_> {
    #[inline(always)]
    fn double_ray<D: F64x4Ops>(&mut self, simd: D) -> DoubleRay<D> {
        let ray = &self.traversal.traces[self.at].ray;
        match self.traversal.tlas.transform(self.context.instance) {
            InstanceTransform::Identity => return DoubleRay::in_world(simd, ray),
            InstanceTransform::Static(transform) => {
                if let Some(ray) = DoubleRay::in_instance(simd, ray, transform) {
                    return ray;
                }
            }
            InstanceTransform::Moving => {}
        }
        DoubleRay::of(simd, self.object_ray())
    }

    #[inline(always)]
    fn object_ray(&mut self) -> &ObjectRay {
        let PacketTraversal { tlas, traces, .. } = *self.traversal;
        self.traversal.instance_ray(self.context, self.at).object_ray(tlas, &traces[self.at])
    }
}

/// The instance that rays of the packet are in.
struct InstanceContext<'a> {
    instance: u32,
    built: &'a BuiltBlas,
}

/// What the leaves of a tree hold: instances or primitives.
trait LeafVisitor {
    /// The packet's rays in the space of the tree.
    fn ray_soa<'p>(&self, packet: &'p Packet) -> &'p RaySoA;

    /// Visits a leaf with some rays.
    fn visit_leaf<E: LaneOps>(&self, traversal: &mut PacketTraversal, simd: E, leaf: NodeRef, rays: u64);
}

/// The numbers of the instances, in tree order.
struct TlasLeaves<'a>(&'a [u32]);

impl LeafVisitor for TlasLeaves<'_> {
    #[inline(always)]
    fn ray_soa<'p>(&self, packet: &'p Packet) -> &'p RaySoA {
        &packet.world_soa
    }

    #[inline(always)]
    fn visit_leaf<E: LaneOps>(&self, traversal: &mut PacketTraversal, simd: E, leaf: NodeRef, rays: u64) {
        if rays != 0 {
            simd.dispatch(InstanceTask { traversal, instance: self.0[leaf.index()], rays });
        }
    }
}

impl LeafVisitor for InstanceContext<'_> {
    #[inline(always)]
    fn ray_soa<'p>(&self, packet: &'p Packet) -> &'p RaySoA {
        &packet.instance_soa
    }

    #[inline(always)]
    fn visit_leaf<E: LaneOps>(&self, traversal: &mut PacketTraversal, simd: E, leaf: NodeRef, rays: u64) {
        if rays != 0 {
            simd.dispatch(LeafTask { traversal, context: self, leaf, rays });
        }
    }
}

/// Iterates over the indices of the bits that are set.
#[inline(always)]
fn bits(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let at = set.trailing_zeros() as usize % MAX_RAYS;
        let found = (set != 0).then_some(at);
        set &= set.wrapping_sub(1);
        found
    })
}
