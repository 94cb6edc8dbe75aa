//! Incoherent rays that take turns in the tree of one instance: while one waits for a node or a
//! leaf, another goes on.

use crate::accel::built_blas::{BuiltBlas, PrimitiveBlocks, WholeBlock};
use crate::accel::instance_ray::InstanceRay;
use crate::accel::node::NodeRef;
use crate::accel::opaque_traversal::{ClosestSoFar, OpaqueInstance};
use crate::accel::packet::{MAX_RAYS, Packet, PacketHit};
use crate::accel::tlas::{InstanceTransform, Tlas};
use crate::accel::trace_ray::TraceRay;
use crate::accel::trav_ray::{NodeLimit, Slabs};
use crate::accel::traversal_stack::TreeStack;
use crate::accel::world_space_ray::WorldSpaceRay;
use crate::math::f32x8::F32x8Ops;
use crate::math::lane_ops::{LaneOps, LaneTask};
use crate::math::prefetch::prefetch;

/// How many rays take turns. (With three or four the code of one turn takes as long as what it
/// hides.)
pub(super) const WAYS: usize = 2;

/// Trees of fewer inner nodes, one MiB, stay in the caches, and no ray waits for long.
const MIN_NODES: usize = 4096;

/// Whether a structure is such that taking turns pays.
pub(super) fn pays(tlas: &Tlas) -> bool {
    let [instance] = tlas.instances() else { return false };
    let bvh = instance.blas.built_already().and_then(BuiltBlas::bvh);
    bvh.is_some_and(|bvh| bvh.node_count() >= MIN_NODES)
}

/// Rays that are traced in turns. Returns a mask of those that are left to be traced otherwise.
pub(super) struct Turns<'a> {
    pub packet: &'a mut Packet,
    pub tlas: &'a Tlas,
    pub traces: &'a [TraceRay],
    /// A mask of the rays.
    pub rays: u64,
    pub any_opaque_hit: bool,
}

impl LaneTask for Turns<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<E: LaneOps>(self, simd: E) -> u64 {
        let Self { tlas, rays, .. } = self;
        let ([instance], InstanceTransform::Identity) = (tlas.instances(), tlas.transform(0)) else {
            return rays;
        };
        let Some(built) = instance.blas.built_already() else { return rays };
        match built.blocks() {
            PrimitiveBlocks::Triangles(blocks) => self.trace(simd, built, blocks),
            PrimitiveBlocks::Spheres(blocks) => self.trace(simd, built, blocks),
            _ => rays,
        }
    }
}

impl Turns<'_> {
    #[inline(always)]
    fn trace<E: LaneOps, B: WholeBlock>(self, simd: E, built: &BuiltBlas, blocks: &[B]) -> u64 {
        let Self { packet, tlas, traces, rays, any_opaque_hit } = self;
        let Some(bvh) = built.bvh() else { return rays };
        let Packet { turn_stacks, instance_rays, hits, hit, .. } = packet;
        *hit &= !rays;
        let mut stacks = turn_stacks.each_mut().map(|stack| stack.room_for(bvh));
        let mut queue = Queue { waiting: rays, left: 0, built, traces, tlas };
        let mut ways = [const { None }; WAYS];
        for way in &mut ways {
            queue.begin_next(simd, way);
        }
        while ways.iter().any(Option::is_some) {
            for at in 0..WAYS {
                let Some(way) = &mut ways[at] else { continue };
                match way.take_turn(simd, blocks, &mut stacks[at], &mut instance_rays[at], any_opaque_hit) {
                    Turn::GoesOn => continue,
                    Turn::Ends => {
                        if let Some(closest) = &way.found.closest {
                            let ordered_index = built.ordered_index(closest.leaf, closest.lane) as u32;
                            let intersection = way.instance.flipped(closest.intersection);
                            hits[way.at] = PacketHit { instance: 0, ordered_index, intersection };
                            *hit |= 1 << way.at;
                        }
                    }
                    Turn::Undecided => queue.left |= 1 << way.at,
                }
                stacks[at].clear();
                instance_rays[at].enter_with_world_slabs(0);
                queue.begin_next(simd, &mut ways[at]);
            }
        }
        queue.left
    }
}

/// The rays that have not begun.
struct Queue<'a> {
    /// A mask of those that will.
    waiting: u64,
    /// A mask of those that will not.
    left: u64,
    built: &'a BuiltBlas,
    traces: &'a [TraceRay],
    tlas: &'a Tlas,
}

impl<'a> Queue<'a> {
    /// Puts the next ray on the way, if there is one.
    #[inline(always)]
    fn begin_next<E: LaneOps>(&mut self, simd: E, way: &mut Option<Way<'a>>) {
        *way = None;
        while self.waiting != 0 && way.is_none() {
            let at = self.waiting.trailing_zeros() as usize % MAX_RAYS;
            self.waiting &= self.waiting - 1;
            let instance = OpaqueInstance::new(self.built, &self.traces[at], self.tlas, 0);
            *way = match instance {
                Some(instance) if instance.is_passed_by() => continue,
                Some(instance) => Way::new(simd, instance, at),
                // The leaves are not tested as wholes in this precision.
                None => None,
            };
            if way.is_none() {
                self.left |= 1 << at;
            }
        }
    }
}

/// What a ray has come to when its turn is over.
enum Turn {
    GoesOn,
    Ends,
    /// Exact arithmetic or the order of hits has to decide.
    Undecided,
}

/// A ray on its way.
struct Way<'a> {
    instance: OpaqueInstance<'a>,
    /// The number of the ray in the packet.
    at: usize,
    in_tree: WorldSpaceRay,
    t_min: f32,
    /// What [`OpaqueInstance::shown_surfaces`] says.
    shown: [u32; 2],
    /// The node or leaf that its next turn visits.
    next: NodeRef,
    found: ClosestSoFar,
}

impl<'a> Way<'a> {
    /// `None` for a ray that the tree does not take in f32.
    #[inline(always)]
    fn new<E: LaneOps>(simd: E, instance: OpaqueInstance<'a>, at: usize) -> Option<Self> {
        let (ray, bvh) = (&instance.trace().ray, instance.bvh());
        Some(Self {
            at,
            in_tree: WorldSpaceRay::new(simd, ray, bvh.world_space())?,
            t_min: ray.t_min,
            shown: instance.shown_surfaces(),
            next: bvh.root(),
            found: ClosestSoFar { cull_t: ray.t_max, closest: None },
            instance,
        })
    }

    /// Visits one node or leaf, and prefetches what the next turn visits.
    #[inline(always)]
    fn take_turn<E: LaneOps, B: WholeBlock>(
        &mut self,
        simd: E,
        blocks: &[B],
        stack: &mut TreeStack,
        instance_ray: &mut InstanceRay,
        any_opaque_hit: bool,
    ) -> Turn {
        let bvh = self.instance.bvh();
        let mut next = None;
        if self.next.is_leaf() {
            let mut ray = self.instance.leaf_ray(instance_ray);
            let Self { instance, next, shown, found, .. } = self;
            let (_, undecided) = instance.test_leaf(simd, blocks, *next, &mut ray, *shown, found);
            if undecided != 0 {
                return Turn::Undecided;
            }
            if any_opaque_hit && found.closest.is_some() {
                return Turn::Ends;
            }
        } else {
            if B::IS_PREFETCHED_WITH_NODE {
                bvh.leaves_to_prefetch(self.next).for_each(|leaf| prefetch(blocks, leaf));
            }
            let slabs = Slabs::in_world(simd, &self.in_tree, self.t_min);
            let limit = F32x8Ops::splat(simd, NodeLimit::unshifted(self.found.cull_t).0);
            next = stack.push_children(bvh.node(self.next), &slabs, limit).map(|(nearest, _)| nearest);
        }
        let Some(next) = next.or_else(|| stack.pop(NodeLimit::unshifted(self.found.cull_t))) else {
            return Turn::Ends;
        };
        if next.is_leaf() {
            prefetch(blocks, next.index());
        } else {
            bvh.prefetch(next);
        }
        self.next = next;
        Turn::GoesOn
    }
}
