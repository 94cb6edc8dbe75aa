//! The BVH traversal of one ray: through the tree over the instances (TLAS) and the tree of each
//! instance that the ray enters (BLAS).

use std::sync::Arc;

use crate::accel::built_blas::BuiltBlas;
use crate::accel::flags::{GeometryFlags, InstanceFlags};
use crate::accel::hit::{Candidate, HitPrimitive};
use crate::accel::hit_queue::HitQueue;
use crate::accel::instance_ray::InstanceRay;
use crate::accel::micromap::is_two_state;
use crate::accel::node::NodeRef;
use crate::accel::observer::{InstanceVerdict, PrimitiveVerdict, TraversalObserver};
use crate::accel::opaque_traversal::{OpaqueInstance, OpaqueTraversal, WorldTraversal};
use crate::accel::primitive_numbers::GeomPrim;
use crate::accel::rules::{
    apply_flip_facing, is_culled_by_face, is_culled_by_opacity, is_opaque, is_skipped, is_visible,
};
use crate::accel::tlas::{InstanceTransform, Tlas};
use crate::accel::trace_ray::TraceRay;
use crate::accel::trav_ray::TravRay;
use crate::accel::traversal_stack::{Stack, StackEntry};
use crate::geometry::{Intersection, Intersection4, ObjectRay, Precision};
use crate::math::baseline_simd::BaselineSimd;
use crate::math::f32x8::F32x8Ops;
use crate::math::lane_ops::{LaneOps, LaneTask};

/// The state of a traversal: the stack and the ray in the spaces of the TLAS and of the instance
/// that it is in. The entries of that instance are on top of the stack.
#[derive(Clone, Debug)]
pub(super) struct TraversalState {
    stack: Stack,
    /// The ray prepared for the nodes of the TLAS, if that has a tree.
    world_ray: TravRay,
    instance_ray: InstanceRay,
    in_instance: bool,
    /// What is built of the instance's BLAS, where that is not the whole.
    part: Option<Arc<BuiltBlas>>,
}

impl TraversalState {
    /// Placeholder value.
    pub(super) const EMPTY: Self = Self {
        stack: Stack::EMPTY,
        world_ray: TravRay::EMPTY,
        instance_ray: InstanceRay::EMPTY,
        in_instance: false,
        part: None,
    };

    /// Whether no unvisited node can hold a hit at t or before. A node that is entered exactly at t
    /// may hold a hit at t.
    #[inline]
    pub(super) fn is_past(&self, t: f32) -> bool {
        self.stack.t_lower_bound().is_none_or(|bound| t < bound)
    }

    /// Traces a ray through a structure of one instance whose leaves are tested as wholes, where
    /// no shader decides; commits the hit. Returns `false`, and does nothing, for any other.
    #[inline(always)]
    pub(super) fn trace_only_instance(&mut self, hits: &mut HitQueue, trace: &TraceRay, tlas: &Tlas) -> bool {
        let [instance] = tlas.instances() else { return false };
        let Some(built) = instance.blas.built_already() else { return false };
        let Some(instance) = OpaqueInstance::new(built, trace, tlas, 0) else { return false };
        if instance.is_passed_by() {
            return true;
        }
        let (instance, Self { stack, instance_ray, .. }) = (&instance, self);
        stack.clear();
        if matches!(tlas.transform(0), InstanceTransform::Identity)
            && tlas.cpu_tier().run(WorldTraversal { instance, stack, instance_ray, hits })
        {
            return true;
        }
        if instance_ray.enter(tlas, 0, Some(instance.bvh()), trace, hits.cull_t) {
            tlas.cpu_tier().run(OpaqueTraversal { instance, stack, instance_ray, hits });
        }
        hits.commit_closest();
        true
    }

    /// Whether the instance's BLAS is built in part. Only a traversal with an observer goes on in
    /// it.
    #[inline]
    pub(super) fn is_in_part(&self) -> bool {
        self.part.is_some()
    }

    /// Forgets the instance that an earlier traversal was in.
    #[inline]
    pub(super) fn leave_part(&mut self) {
        self.part = None;
    }

    /// Whether the stack is empty.
    pub(super) fn is_over(&self) -> bool {
        self.stack.len() == 0
    }
}

/// The arguments of one step of a cursor, each of which fits into a register. A larger
/// argument would be copied through vector registers, which stalls on store forwarding.
pub(super) struct TraversalTask<'a, V, const FULLY_OPAQUE: bool> {
    pub traversal: &'a mut TraversalState,
    pub hits: &'a mut HitQueue,
    pub trace: &'a TraceRay,
    pub tlas: &'a Tlas,
    pub observer: &'a mut V,
    /// Whether the traversal begins at the root.
    pub start: bool,
}

impl<V: TraversalObserver, const FULLY_OPAQUE: bool> LaneTask for TraversalTask<'_, V, FULLY_OPAQUE> {
    type Output = bool;

    #[inline(always)]
    fn run<E: LaneOps>(self, simd: E) -> bool {
        let Self { traversal, hits, trace, tlas, observer, start } = self;
        Traversal::<V, FULLY_OPAQUE> {
            traversal,
            hits,
            trace,
            tlas,
            observer,
            leaf_hits: Intersection4::MISSED,
        }
        .resume(simd, start)
    }
}

/// A traversal while it runs.
struct Traversal<'a, V, const FULLY_OPAQUE: bool> {
    traversal: &'a mut TraversalState,
    hits: &'a mut HitQueue,
    trace: &'a TraceRay,
    tlas: &'a Tlas,
    observer: &'a mut V,
    /// The results for the current leaf, if all its primitives are tested at once.
    leaf_hits: Intersection4,
}

impl<V: TraversalObserver, const FULLY_OPAQUE: bool> Traversal<'_, V, FULLY_OPAQUE> {
    #[inline(always)]
    fn resume<E: LaneOps>(mut self, simd: E, start: bool) -> bool {
        if start {
            self.begin(simd);
        }
        loop {
            if !FULLY_OPAQUE && self.is_candidate_next() {
                return true;
            }
            if self.traversal.in_instance {
                self.traverse_instance(simd);
                self.traversal.in_instance =
                    self.traversal.stack.len() > self.traversal.instance_ray.stack_base;
            } else {
                let Some(entry) = self.traversal.stack.pop::<FULLY_OPAQUE>() else { return false };
                if entry.t_near() <= self.traversal.world_ray.limit(self.hits.cull_t).0 {
                    self.visit_tlas_entry(simd, entry);
                }
            }
            if self.hits.can_end_early() {
                self.hits.clear_candidates();
                self.traversal.stack.clear();
                self.traversal.in_instance = false;
                return false;
            }
        }
    }

    /// Whether the first waiting candidate is certainly next in the order of hits.
    #[inline(always)]
    fn is_candidate_next(&self) -> bool {
        self.hits.first_candidate_t().is_some_and(|t| self.traversal.is_past(t))
    }

    /// Pushes the root; a single instance is entered at once.
    #[inline(always)]
    fn begin<E: LaneOps>(&mut self, simd: E) {
        self.traversal.stack.clear();
        self.traversal.in_instance = false;
        let count = self.tlas.instances().len();
        if count == 1 {
            self.visit_instance(simd, 0);
        } else if count > 1 && self.trace.ray.is_finite() {
            self.begin_tlas(count);
        }
    }

    #[inline(never)]
    fn begin_tlas(&mut self, count: usize) {
        let ray = &self.trace.ray;
        let TraversalState { stack, world_ray, .. } = &mut *self.traversal;
        let root = match self.tlas.bvh() {
            None if self.tlas.is_linear() => {
                *world_ray = TravRay::with_t_min(ray.t_min);
                NodeRef::leaf(0, count)
            }
            // No instance holds anything that can be hit.
            None => return,
            Some((bvh, _)) => {
                if !world_ray.set_world_space(ray, bvh.world_space()) {
                    let Some(object_ray) = ObjectRay::in_world(ray) else { return };
                    let trav_ray = TravRay::new(&object_ray, ray.t_max, bvh.bounds(), bvh.scale());
                    let Some(trav_ray) = trav_ray else { return };
                    *world_ray = trav_ray;
                }
                bvh.root()
            }
        };
        stack.push::<FULLY_OPAQUE>(StackEntry::new(root, world_ray.shifted_t_min), world_ray);
    }

    #[inline(always)]
    fn visit_tlas_entry<E: LaneOps>(&mut self, simd: E, entry: StackEntry) {
        let TraversalState { stack, world_ray, .. } = &mut *self.traversal;
        let child = entry.node();
        match (child.count(), self.tlas.bvh()) {
            (0, Some((bvh, _))) => {
                self.observer.node(None);
                let (limit, slabs) = (world_ray.limit(self.hits.cull_t), world_ray.slabs(simd));
                let node = bvh.node(child);
                if let Some(nearest) = stack.push_children::<_, FULLY_OPAQUE>(limit, node, world_ray, &slabs)
                {
                    stack.push::<FULLY_OPAQUE>(nearest, world_ray);
                }
            }
            (1, bvh) => {
                self.visit_instance(
                    simd,
                    bvh.map_or(child.index() as u32, |(_, order)| order[child.index()]),
                );
            }
            _ => {
                // The first in tree order comes to the top.
                for single in child.single_leaves().rev() {
                    stack.push::<FULLY_OPAQUE>(StackEntry::new(single, entry.t_near()), world_ray);
                }
            }
        }
    }

    #[inline(always)]
    fn visit_instance<E: LaneOps>(&mut self, simd: E, number: u32) {
        let verdict = self.enter_instance(simd, number);
        self.observer.instance(number, verdict);
    }

    /// Enters an instance. Tests its primitives at once if it has no tree, and traverses its tree
    /// at once where [`OpaqueTraversal`] can; otherwise pushes the root of its tree.
    #[inline(always)]
    fn enter_instance<E: LaneOps>(&mut self, simd: E, number: u32) -> InstanceVerdict {
        let instance = &self.tlas.instances()[number as usize];
        if !is_visible(instance.mask, self.trace.cull_mask) {
            return InstanceVerdict::Masked;
        }
        if instance.blas.kind().is_some_and(|kind| is_skipped(self.trace.flags, kind)) {
            return InstanceVerdict::Skipped;
        }
        // An observer that explains misses always sees the traversal of a BVH.
        let built = &*if self.observer.explains_misses() {
            instance.blas.primitives_for_explained_ray()
        } else {
            instance.blas.primitives_for_ray(self.tlas.precision() == Precision::Exact)
        };
        let TraversalState { stack, instance_ray, in_instance, part, .. } = &mut *self.traversal;
        if !instance_ray.enter(self.tlas, number, built.bvh(), self.trace, self.hits.cull_t) {
            return InstanceVerdict::Missed;
        }
        let Some(bvh) = built.bvh() else {
            self.intersect_all(simd, built);
            return InstanceVerdict::Entered;
        };
        if self.observer.explains_misses()
            && TravRay::misses(instance_ray.object_ray(self.tlas, self.trace), self.hits.cull_t, bvh.bounds())
        {
            return InstanceVerdict::Missed;
        }
        if V::is_active() {
            *part = None;
            if self.observer.explains_misses() {
                // The closure is called through a pointer, so not as a part of what is compiled for
                // the instruction set of `simd`.
                let limit = F32x8Ops::splat(BaselineSimd, instance_ray.trav_ray.limit(self.hits.cull_t).0);
                let slabs = instance_ray.trav_ray.slabs(BaselineSimd);
                // The limit only falls: the ray opens no other nodes.
                *part = instance.blas.grow(&mut |node| node.intersect(&slabs, limit).1);
            }
        }
        if FULLY_OPAQUE && let Some(instance) = OpaqueInstance::new(built, self.trace, self.tlas, number) {
            if !is_culled_by_opacity(self.trace.flags, true) {
                let (instance, hits) = (&instance, &mut *self.hits);
                simd.dispatch(OpaqueTraversal { instance, stack, instance_ray, hits });
            }
            return InstanceVerdict::Entered;
        }
        instance_ray.stack_base = stack.len();
        stack.push::<FULLY_OPAQUE>(
            StackEntry::new(bvh.root(), instance_ray.trav_ray.shifted_t_min),
            &instance_ray.trav_ray,
        );
        *in_instance = true;
        InstanceVerdict::Entered
    }

    /// Visits the entries of the current instance until a candidate is next in the order of hits.
    #[inline(always)]
    fn traverse_instance<E: LaneOps>(&mut self, simd: E) {
        let number = self.traversal.instance_ray.instance;
        let base = self.traversal.instance_ray.stack_base;
        let part = if V::is_active() { self.traversal.part.clone() } else { None };
        let built = match &part {
            Some(part) => part,
            None => self.tlas.instances()[number as usize].blas.built(),
        };
        let Some(bvh) = built.bvh() else { return };
        let slabs = self.traversal.instance_ray.trav_ray.slabs(simd);
        let mut limit = self.traversal.instance_ray.trav_ray.limit(self.hits.cull_t);
        while self.traversal.stack.len() > base {
            let Some(entry) = self.traversal.stack.pop::<FULLY_OPAQUE>() else { return };
            if entry.t_near() > limit.0 {
                continue;
            }
            let mut child = entry.node();
            // Descend to the nearest leaf; farther children wait on the stack.
            while !child.is_leaf() {
                self.observer.node(Some(number));
                built.prefetch_leaves(bvh, child);
                let TraversalState { stack, instance_ray, .. } = &mut *self.traversal;
                let (ray, before) = (&instance_ray.trav_ray, stack.len());
                match stack.push_children::<E, FULLY_OPAQUE>(limit, bvh.node(child), ray, &slabs) {
                    Some(nearest) => child = nearest.node(),
                    None => break,
                }
                // This entry is visited next unless a nearer one is pushed.
                if let Some(other) = stack.top().filter(|_| stack.len() > before) {
                    built.prefetch(other.node());
                }
            }
            if child.is_leaf() {
                built.prefetch_numbers(child);
                let maybe_hit = self.maybe_hit_mask(simd, built, child);
                if maybe_hit == 0 {
                    continue;
                }
                self.intersect_primitives(built, child, maybe_hit);
                if self.hits.can_end_early() || !FULLY_OPAQUE && self.is_candidate_next() {
                    return;
                }
                limit = self.traversal.instance_ray.trav_ray.limit(self.hits.cull_t);
            }
        }
    }

    /// Tests the primitives of an instance without a tree.
    #[inline(always)]
    fn intersect_all<E: LaneOps>(&mut self, simd: E, built: &BuiltBlas) {
        let mut leaves = built.leaves();
        let Some(first) = leaves.next() else { return };
        // Preparing a ray for culling does not pay for a single block.
        let maybe_hit = if built.tests_whole_leaves(self.tlas.precision()) {
            self.maybe_hit_mask(simd, built, first)
        } else {
            built.full_mask(first)
        };
        self.intersect_primitives(built, first, maybe_hit);
        for leaf in leaves {
            if self.hits.can_end_early() {
                break;
            }
            let maybe_hit = self.maybe_hit_mask(simd, built, leaf);
            self.intersect_primitives(built, leaf, maybe_hit);
        }
    }

    /// Whether the observer sees each primitive of a leaf by itself. Where primitives are split,
    /// only those are counted that have not been seen before.
    #[inline(always)]
    fn tests_each(&self, built: &BuiltBlas) -> bool {
        self.observer.explains_misses() && (!self.observer.only_counts() || built.has_split_primitives())
    }

    /// A mask of the primitives of a leaf that the ray may hit.
    #[inline(always)]
    fn maybe_hit_mask<E: LaneOps>(&mut self, simd: E, built: &BuiltBlas, leaf: NodeRef) -> u32 {
        let tests_each = self.tests_each(built);
        let instance_ray = &mut self.traversal.instance_ray;
        let maybe_hit = if tests_each {
            built.full_mask(leaf)
        } else if built.tests_whole_leaves(self.tlas.precision()) {
            let mut ray = instance_ray.leaf_ray::<false>(self.tlas, self.trace);
            self.leaf_hits = built.intersect_leaf(simd, leaf, &mut ray, self.hits.cull_t);
            self.leaf_hits.maybe_hit_mask() & built.full_mask(leaf)
        } else {
            instance_ray.maybe_hit_mask::<E, true>(simd, self.tlas, built, leaf, self.trace)
        };
        self.observer.missed(leaf.count() - maybe_hit.count_ones());
        maybe_hit
    }

    /// Intersects the primitives of a leaf that a mask selects.
    #[inline(always)]
    fn intersect_primitives(&mut self, built: &BuiltBlas, leaf: NodeRef, mut rest: u32) {
        let number = self.traversal.instance_ray.instance;
        let instance = &self.tlas.instances()[number as usize];
        let flags = self.trace.flags;
        let common = built.common_flags();
        let precision = self.tlas.precision();
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let (geometry_flags, micromap) = match common {
                _ if FULLY_OPAQUE => (GeometryFlags::OPAQUE, None),
                Some(flags) => (flags, None),
                None => {
                    let geom_prim = built.geom_prim(leaf, lane);
                    let geometry = &instance.blas.geometries()[geom_prim.geometry as usize];
                    let enabled = !instance.flags.contains(InstanceFlags::DISABLE_OPACITY_MICROMAPS);
                    (geometry.flags, geometry.opacity_micromap.as_deref().filter(|_| enabled))
                }
            };
            let mut opaque = FULLY_OPAQUE || is_opaque(flags, instance.flags, geometry_flags);
            let mut culled = is_culled_by_opacity(flags, opaque);
            if culled && micromap.is_none() && !self.tests_each(built) {
                if self.observer.only_counts() {
                    self.observer.missed(1);
                }
                continue;
            }
            let at = (number, leaf, lane);
            if V::is_active()
                && built.has_split_primitives()
                && !self.hits.is_first_report(hit_primitive(built, at))
            {
                continue;
            }
            let leaf_hit = self
                .leaf_hits
                .hit(lane)
                .filter(|_| !self.tests_each(built) && built.tests_whole_leaves(precision));
            let found = match leaf_hit {
                None => {
                    let ray = self.traversal.instance_ray.object_ray(self.tlas, self.trace);
                    built.intersect(leaf, lane, ray, self.trace.time, precision)
                }
                found => found,
            };
            let Some(found) = found.filter(|found| V::is_active() || found.t <= self.hits.cull_t) else {
                // Where nobody asks, the number of what was missed is not read.
                if V::is_active() {
                    let verdict = if self.observer.explains_misses() && !self.observer.only_counts() {
                        let ray = self.traversal.instance_ray.object_ray(self.tlas, self.trace);
                        missed_or_outside(self.tlas, built, at, ray, self.trace.time)
                    } else {
                        PrimitiveVerdict::Missed
                    };
                    self.observer.primitive(hit_primitive(built, at), verdict);
                }
                continue;
            };
            let hit_primitive = hit_primitive(built, at);
            let found = Intersection { surface: apply_flip_facing(found.surface, instance.flags), ..found };
            if let Some(micromap) = micromap {
                let opacity = micromap.opacity(hit_primitive.primitive, found.attributes);
                let Some(is_opaque_there) = opacity.is_opaque(is_two_state(flags, instance.flags)) else {
                    self.observer.primitive(hit_primitive, PrimitiveVerdict::Transparent(found));
                    continue;
                };
                let part_flags =
                    if is_opaque_there { GeometryFlags::OPAQUE } else { GeometryFlags::default() };
                opaque = is_opaque(flags, instance.flags, part_flags);
                culled = is_culled_by_opacity(flags, opaque);
            }
            let verdict = if culled {
                PrimitiveVerdict::CulledByOpacity(found)
            } else if is_culled_by_face(flags, instance.flags, found.surface) {
                PrimitiveVerdict::CulledByFace(found)
            } else {
                let HitPrimitive { instance, geometry, primitive } = hit_primitive;
                self.add_hit(Candidate { instance, geometry, primitive, intersection: found, opaque })
            };
            self.observer.primitive(hit_primitive, verdict);
        }
    }

    #[inline(always)]
    fn add_hit(&mut self, candidate: Candidate) -> PrimitiveVerdict {
        let found = candidate.intersection;
        let wants_all = V::is_active() && self.observer.wants_all_hits();
        if !wants_all && (FULLY_OPAQUE || candidate.opaque && !candidate.is_box()) {
            if self.hits.add_opaque(candidate) {
                return PrimitiveVerdict::Opaque(found);
            }
        } else if self.hits.queue_candidate(candidate) {
            return PrimitiveVerdict::Candidate(found);
        }
        PrimitiveVerdict::Behind(found)
    }
}

/// The primitive in a lane of a leaf, in the instance of a number.
#[inline(always)]
fn hit_primitive(built: &BuiltBlas, (instance, leaf, lane): (u32, NodeRef, usize)) -> HitPrimitive {
    let GeomPrim { geometry, primitive } = built.geom_prim(leaf, lane);
    HitPrimitive { instance, geometry, primitive }
}

/// Says why a primitive was not hit, by testing it again over all t >= 0.
#[cold]
fn missed_or_outside(
    tlas: &Tlas,
    built: &BuiltBlas,
    (instance, leaf, lane): (u32, NodeRef, usize),
    ray: &ObjectRay,
    time: f32,
) -> PrimitiveVerdict {
    let whole = ray.world().with_interval(0.0, f32::INFINITY);
    tlas.object_ray(instance, &whole, time)
        .and_then(|whole| built.intersect(leaf, lane, &whole, time, tlas.precision()))
        .map_or(PrimitiveVerdict::Missed, PrimitiveVerdict::OutsideInterval)
}
