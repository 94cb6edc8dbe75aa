//! The traversal of the tree of one instance where no shader decides and the primitives of a leaf
//! are tested all at once: the innermost loop of most rays, in a function of its own.
//!
//! A ray that shaders may have to decide about goes through `traversal`, which finds the same hits.

use crate::accel::built_blas::{BuiltBlas, LeafRay, PrimitiveBlocks, WholeBlock};
use crate::accel::flags::InstanceFlags;
use crate::accel::hit::{Candidate, Committed};
use crate::accel::hit_queue::HitQueue;
use crate::accel::instance_ray::{InstanceLeafRay, InstanceRay};
use crate::accel::node::NodeRef;
use crate::accel::primitive_numbers::GeomPrim;
use crate::accel::rules::{apply_flip_facing, culls_faces, is_culled_by_face};
use crate::accel::tlas::Tlas;
use crate::accel::trace_ray::TraceRay;
use crate::accel::trav_ray::{NodeLimit, Slabs};
use crate::accel::traversal_stack::Stack;
use crate::accel::wide_bvh::WideBvh;
use crate::accel::world_space_ray::WorldSpaceRay;
use crate::geometry::{Intersection, Surface};
use crate::math::f32x8::F32x8Ops;
use crate::math::lane_ops::{LaneOps, LaneTask};
use crate::math::prefetch::prefetch;

/// The mask of the four primitives of a block.
const ALL: u32 = 0b1111;

/// The traversal of the instance that a ray has entered, from the root of its tree on. The
/// arguments of a function, each of which fits into a register.
pub(super) struct OpaqueTraversal<'a> {
    pub instance: &'a OpaqueInstance<'a>,
    pub stack: &'a mut Stack,
    pub instance_ray: &'a mut InstanceRay,
    pub hits: &'a mut HitQueue,
}

impl LaneTask for OpaqueTraversal<'_> {
    type Output = ();

    #[inline(always)]
    fn run<E: LaneOps>(self, simd: E) {
        let Self { instance, stack, instance_ray, hits } = self;
        let slabs = instance_ray.trav_ray.slabs(simd);
        if let Some(found) = instance.traverse_tree::<E, false>(slabs, stack, instance_ray, hits) {
            hits.add_opaque(instance.candidate(&found));
        }
    }
}

/// The traversal of an instance that stands in world space, the first that a ray comes to, by a
/// [well-scaled](crate::geometry::Ray::is_well_scaled) one that starts near it: all that such a ray
/// takes is in this function. It commits the hit; for any other ray it does nothing and returns
/// `false`.
pub(super) struct WorldTraversal<'a> {
    pub instance: &'a OpaqueInstance<'a>,
    pub stack: &'a mut Stack,
    pub instance_ray: &'a mut InstanceRay,
    pub hits: &'a mut HitQueue,
}

impl LaneTask for WorldTraversal<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<E: LaneOps>(self, simd: E) -> bool {
        let Self { instance, stack, instance_ray, hits } = self;
        let ray = &instance.trace.ray;
        let Some(in_tree) = WorldSpaceRay::new(simd, ray, instance.bvh.world_space()) else { return false };
        let slabs = Slabs::in_world(simd, &in_tree, ray.t_min);
        instance_ray.enter_with_world_slabs(instance.number);
        let found = instance.traverse_tree::<E, true>(slabs, stack, instance_ray, hits);
        if hits.closest_opaque.is_some() {
            if let Some(found) = found {
                hits.add_opaque(instance.candidate(&found));
            }
            hits.commit_closest();
        } else if let Some(found) = found {
            hits.committed = Committed::opaque(instance.candidate(&found));
        }
        true
    }
}

/// What a traversal has found so far.
pub(super) struct ClosestSoFar {
    /// No hit behind it matters; a rounded t.
    pub cull_t: f32,
    pub closest: Option<Closest>,
}

/// The closest hit of the instance so far: the primitive in a lane of a leaf.
pub(super) struct Closest {
    pub leaf: NodeRef,
    pub lane: usize,
    pub intersection: Intersection,
}

/// An instance with a tree whose leaves are tested as wholes, and the ray that enters it.
pub(super) struct OpaqueInstance<'a> {
    built: &'a BuiltBlas,
    bvh: &'a WideBvh,
    trace: &'a TraceRay,
    tlas: &'a Tlas,
    /// `InstanceId`
    number: u32,
    flags: InstanceFlags,
}

impl<'a> OpaqueInstance<'a> {
    /// The instance of a number; `None` for any other.
    #[inline(always)]
    pub(super) fn new(
        built: &'a BuiltBlas,
        trace: &'a TraceRay,
        tlas: &'a Tlas,
        number: u32,
    ) -> Option<Self> {
        let bvh = built.bvh().filter(|_| built.tests_whole_leaves(tlas.precision()))?;
        let flags = tlas.instances()[number as usize].flags;
        Some(Self { built, bvh, trace, tlas, number, flags })
    }

    /// Its tree.
    #[inline(always)]
    pub(super) fn bvh(&self) -> &'a WideBvh {
        self.bvh
    }

    /// The operands of the trace.
    #[inline(always)]
    pub(super) fn trace(&self) -> &'a TraceRay {
        self.trace
    }

    /// Whether the masks or the flags of the ray let it pass all of the instance.
    #[inline(always)]
    pub(super) fn is_passed_by(&self) -> bool {
        let TraceRay { flags, cull_mask, .. } = *self.trace;
        self.tlas.instances()[self.number as usize].is_passed_by(flags, cull_mask)
    }

    /// The ray for tests of leaves, if it is well scaled and the instance stands in world space.
    #[inline(always)]
    pub(super) fn leaf_ray<'r>(&self, instance_ray: &'r mut InstanceRay) -> InstanceLeafRay<'r, true>
    where
        'a: 'r,
    {
        instance_ray.leaf_ray(self.tlas, self.trace)
    }

    /// Traverses the tree; returns the closest hit, unless that was added to `hits`.
    #[inline(always)]
    fn traverse_tree<E: LaneOps, const WELL_SCALED: bool>(
        &self,
        slabs: Slabs<E>,
        stack: &mut Stack,
        instance_ray: &mut InstanceRay,
        hits: &mut HitQueue,
    ) -> Option<Closest> {
        match self.built.blocks() {
            PrimitiveBlocks::Triangles(blocks) => {
                self.traverse::<E, _, WELL_SCALED>(slabs, blocks, stack, instance_ray, hits)
            }
            PrimitiveBlocks::Spheres(blocks) => {
                self.traverse::<E, _, WELL_SCALED>(slabs, blocks, stack, instance_ray, hits)
            }
            _ => None,
        }
    }

    #[inline(always)]
    fn traverse<E: LaneOps, B: WholeBlock, const WELL_SCALED: bool>(
        &self,
        slabs: Slabs<E>,
        blocks: &[B],
        stack: &mut Stack,
        instance_ray: &mut InstanceRay,
        hits: &mut HitQueue,
    ) -> Option<Closest> {
        let Self { bvh, trace, tlas, .. } = *self;
        let simd = slabs.simd;
        let limit_at = |instance_ray: &InstanceRay, t| {
            if WELL_SCALED { NodeLimit::unshifted(t) } else { instance_ray.trav_ray.limit(t) }
        };
        let shown = self.shown_surfaces();
        let mut stack = stack.room_for(bvh);
        let mut found = ClosestSoFar { cull_t: hits.cull_t, closest: None };
        let mut limit = limit_at(instance_ray, found.cull_t);
        let mut next = Some(bvh.root());
        while let Some(mut child) = next {
            // Descend to the nearest leaf; farther children wait on the stack.
            while !child.is_leaf() {
                if B::IS_PREFETCHED_WITH_NODE {
                    bvh.leaves_to_prefetch(child).for_each(|leaf| prefetch(blocks, leaf));
                }
                let limits = F32x8Ops::splat(simd, limit.0);
                let Some((nearest, other)) = stack.push_children(bvh.node(child), &slabs, limits) else {
                    break;
                };
                child = nearest;
                // This entry is visited next unless a nearer one is pushed.
                match other {
                    Some(leaf) if leaf.is_leaf() => prefetch(blocks, leaf.index()),
                    Some(node) => bvh.prefetch(node),
                    None => {}
                }
            }
            if !child.is_leaf() {
                next = stack.pop(limit);
                continue;
            }
            let mut ray = instance_ray.leaf_ray::<WELL_SCALED>(tlas, trace);
            let (has_hits, undecided) = self.test_leaf(simd, blocks, child, &mut ray, shown, &mut found);
            if !has_hits && undecided == 0 {
                next = stack.pop(limit);
                continue;
            }
            if undecided != 0 {
                if let Some(closest) = found.closest.take() {
                    hits.add_opaque(self.candidate(&closest));
                }
                self.decide(hits, instance_ray, child, undecided);
                found.cull_t = hits.cull_t;
            }
            if hits.any_opaque_hit_ends && (found.closest.is_some() || hits.closest_opaque.is_some()) {
                break;
            }
            limit = limit_at(instance_ray, found.cull_t);
            next = stack.pop(limit);
        }
        found.closest
    }

    /// Tests the primitives of a leaf, and takes over the closest hit, to which `cull_t` falls.
    /// Returns whether there were any, and a mask of the primitives that exact arithmetic or the
    /// order of hits has to decide about.
    #[inline(always)]
    pub(super) fn test_leaf<E: LaneOps, B: WholeBlock>(
        &self,
        simd: E,
        blocks: &[B],
        leaf: NodeRef,
        ray: &mut impl LeafRay,
        shown: [u32; 2],
        found: &mut ClosestSoFar,
    ) -> (bool, u32) {
        self.built.prefetch_numbers(leaf);
        let tested = blocks[leaf.index()].intersect_all(simd, ray, found.cull_t);
        let filled = self.built.full_mask(leaf);
        let (mut hit, mut undecided) = (tested.hits_on(shown) & filled, tested.undecided() & filled);
        let has_hits = hit != 0;
        while hit != 0 {
            let lane = hit.trailing_zeros() as usize;
            hit &= hit - 1;
            let intersection = tested.intersection(lane);
            if intersection.t < found.cull_t {
                found.cull_t = intersection.t;
                found.closest = Some(Closest { leaf, lane, intersection });
            } else if intersection.t == found.cull_t {
                undecided |= 1 << lane;
            }
        }
        (has_hits, undecided)
    }

    /// For the first and the second surface of [`Intersection4`](crate::geometry::Intersection4) a
    /// mask of the primitives that count where they are hit on it: all or none.
    #[inline(always)]
    pub(super) fn shown_surfaces(&self) -> [u32; 2] {
        if !culls_faces(self.trace.flags) {
            return [ALL; 2];
        }
        let (back, front) = (self.is_culled(Surface::TriangleBack), self.is_culled(Surface::TriangleFront));
        // Spheres have one surface only.
        if self.built.has_triangles() { [ALL * u32::from(!back), ALL * u32::from(!front)] } else { [ALL; 2] }
    }

    /// Whether the ray culls a primitive seen from this side.
    #[inline(always)]
    fn is_culled(&self, surface: Surface) -> bool {
        is_culled_by_face(self.trace.flags, self.flags, apply_flip_facing(surface, self.flags))
    }

    /// The hit of the primitive in a lane of a leaf.
    #[inline(always)]
    fn candidate(&self, &Closest { leaf, lane, intersection: found }: &Closest) -> Candidate {
        let GeomPrim { geometry, primitive } = self.built.geom_prim(leaf, lane);
        let intersection = self.flipped(found);
        Candidate { instance: self.number, geometry, primitive, intersection, opaque: true }
    }

    /// An intersection with the surface as the flags of the instance turn it.
    #[inline(always)]
    pub(super) fn flipped(&self, found: Intersection) -> Intersection {
        Intersection { surface: apply_flip_facing(found.surface, self.flags), ..found }
    }

    /// Tests primitives of a leaf that the filter does not decide, or that are hit as far away as
    /// the closest.
    #[cold]
    #[inline(never)]
    fn decide(&self, hits: &mut HitQueue, instance_ray: &mut InstanceRay, leaf: NodeRef, mut lanes: u32) {
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let ray = instance_ray.object_ray(self.tlas, self.trace);
            let found = self.built.intersect(leaf, lane, ray, self.trace.time, self.tlas.precision());
            if let Some(found) =
                found.filter(|found| found.t <= hits.cull_t && !self.is_culled(found.surface))
            {
                hits.add_opaque(self.candidate(&Closest { leaf, lane, intersection: found }));
            }
        }
    }
}
