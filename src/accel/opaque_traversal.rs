//! The traversal of the tree of one instance where no shader decides and the primitives of a leaf
//! are tested all at once: the innermost loop of most rays, in a function of its own.
//!
//! A ray that shaders may have to decide about goes through `traversal`, which finds the same hits.

use crate::accel::built_blas::{BuiltBlas, PrimitiveBlocks, WholeBlock};
use crate::accel::flags::InstanceFlags;
use crate::accel::hit::Candidate;
use crate::accel::hit_queue::HitQueue;
use crate::accel::instance_ray::InstanceRay;
use crate::accel::node::NodeRef;
use crate::accel::primitive_numbers::GeomPrim;
use crate::accel::rules::{apply_flip_facing, culls_faces, is_culled_by_face, is_culled_by_opacity};
use crate::accel::tlas::Tlas;
use crate::accel::trace_ray::TraceRay;
use crate::accel::traversal_stack::Stack;
use crate::accel::wide_bvh::WideBvh;
use crate::geometry::{Intersection, Surface};
use crate::math::f32x8::F32x8Ops;
use crate::math::lane_ops::{LaneOps, LaneTask};
use crate::math::prefetch::prefetch;

/// The mask of the four primitives of a block.
const ALL: u32 = 0b1111;

/// The traversal of the instance that a ray has entered, from the root of its tree on. The
/// arguments of a function, each of which fits into a register.
pub(super) struct OpaqueTraversal<'a> {
    pub stack: &'a mut Stack,
    pub instance_ray: &'a mut InstanceRay,
    pub hits: &'a mut HitQueue,
    pub trace: &'a TraceRay,
    pub tlas: &'a Tlas,
}

impl LaneTask for OpaqueTraversal<'_> {
    type Output = ();

    #[inline(always)]
    fn run<E: LaneOps>(self, simd: E) {
        let instance = &self.tlas.instances()[self.instance_ray.instance as usize];
        let built = instance.blas.built();
        let Some(bvh) = built.bvh() else { return };
        if is_culled_by_opacity(self.trace.flags, true) {
            return;
        }
        match built.blocks() {
            PrimitiveBlocks::Triangles(blocks) => self.traverse(simd, built, bvh, blocks),
            PrimitiveBlocks::Spheres(blocks) => self.traverse(simd, built, bvh, blocks),
            _ => {}
        }
    }
}

/// The closest hit of the instance so far.
struct Closest {
    leaf: NodeRef,
    lane: usize,
    intersection: Intersection,
}

impl OpaqueTraversal<'_> {
    #[inline(always)]
    fn traverse<E: LaneOps, B: WholeBlock>(self, simd: E, built: &BuiltBlas, bvh: &WideBvh, blocks: &[B]) {
        let Self { stack, instance_ray, hits, trace, tlas } = self;
        let number = instance_ray.instance;
        let context = Context { built, trace, tlas, number, flags: tlas.instances()[number as usize].flags };
        let shown = context.shown_surfaces();
        let slabs = instance_ray.trav_ray.slabs(simd);
        let mut stack = stack.room_for(bvh);
        let mut cull_t = hits.cull_t;
        let mut limit = instance_ray.trav_ray.limit(cull_t);
        let mut closest: Option<Closest> = None;
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
            built.prefetch_numbers(child);
            let mut ray = instance_ray.leaf_ray(tlas, trace);
            let found = blocks[child.index()].intersect_all(simd, &mut ray, cull_t);
            let filled = built.full_mask(child);
            let (mut hit, mut undecided) = (found.hits_on(shown) & filled, found.undecided() & filled);
            if hit | undecided == 0 {
                next = stack.pop(limit);
                continue;
            }
            while hit != 0 {
                let lane = hit.trailing_zeros() as usize;
                hit &= hit - 1;
                let intersection = found.intersection(lane);
                if intersection.t < cull_t {
                    cull_t = intersection.t;
                    closest = Some(Closest { leaf: child, lane, intersection });
                } else if intersection.t == cull_t {
                    // The order of hits decides.
                    undecided |= 1 << lane;
                }
            }
            if undecided != 0 {
                if let Some(found) = closest.take() {
                    hits.add_opaque(context.candidate(found.leaf, found.lane, found.intersection));
                }
                context.decide(hits, instance_ray, child, undecided);
                cull_t = hits.cull_t;
            }
            if hits.any_opaque_hit_ends && (closest.is_some() || hits.closest_opaque.is_some()) {
                break;
            }
            limit = instance_ray.trav_ray.limit(cull_t);
            next = stack.pop(limit);
        }
        if let Some(found) = closest {
            hits.add_opaque(context.candidate(found.leaf, found.lane, found.intersection));
        }
    }
}

/// What the hits of an instance share.
struct Context<'a> {
    built: &'a BuiltBlas,
    trace: &'a TraceRay,
    tlas: &'a Tlas,
    /// `InstanceId`
    number: u32,
    flags: InstanceFlags,
}

impl Context<'_> {
    /// For the first and the second surface of [`Intersection4`](crate::geometry::Intersection4) a
    /// mask of the primitives that count where they are hit on it: all or none.
    #[inline(always)]
    fn shown_surfaces(&self) -> [u32; 2] {
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
    fn candidate(&self, leaf: NodeRef, lane: usize, found: Intersection) -> Candidate {
        let GeomPrim { geometry, primitive } = self.built.geom_prim(leaf, lane);
        let intersection = Intersection { surface: apply_flip_facing(found.surface, self.flags), ..found };
        Candidate { instance: self.number, geometry, primitive, intersection, opaque: true }
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
                hits.add_opaque(self.candidate(leaf, lane, found));
            }
        }
    }
}
