//! One step of a traversal through the trees of a TLAS and its BLASes.

#[cfg(target_arch = "x86_64")]
use pulp::x86::V3;

use crate::accel::blas::GeometryFlags;
use crate::accel::body::Body;
use crate::accel::cursor::{Candidate, Cursor};
use crate::accel::micromap::is_two_state;
use crate::accel::node::{Child, Node, WIDTH};
use crate::accel::node_ray::{NodeLimit, NodeRay, Slabs};
use crate::accel::rules::{
    is_culled_by_face, is_culled_by_opacity, is_opaque, is_skipped, is_visible, presented,
};
use crate::accel::tlas::{InstanceFlags, Tlas};
use crate::accel::visit::{InstanceVerdict, Place, PrimitiveVerdict, Visit};
use crate::geometry::block::BlockRay;
use crate::geometry::{Intersection, ObjectRay};
use crate::math::eight::{Eights, TwoFours};

/// A part of a tree that is still to be visited.
#[derive(Clone, Copy, Debug)]
pub struct Open {
    child: Child,
    /// A lower bound of the rounded t of any hit in it.
    entry: f32,
    /// The least entry of this and all below it on the stack.
    pub floor: f32,
}

/// The BLAS that the upper end of the stack belongs to.
#[derive(Clone, Debug)]
pub struct Level {
    instance: u32,
    /// How many entries of the stack lie below it.
    base: usize,
    object_ray: ObjectRay,
    node_ray: NodeRay,
    block_ray: Option<BlockRay>,
}

impl Level {
    /// Memory for a level.
    const IDLE: Self =
        Self { instance: 0, base: 0, object_ray: ObjectRay::IDLE, node_ray: NodeRay::IDLE, block_ray: None };
}

impl Cursor {
    /// Puts the root on the stack.
    pub(super) fn start(&mut self, tlas: &Tlas) {
        self.open.clear();
        self.level = None;
        self.world = None;
        let ray = &self.trace.ray;
        let Some((tree, _)) = tlas.tree() else {
            let count = tlas.instances().len() as u32;
            if count > 0 && ray.is_finite() {
                push(&mut self.open, Child { first: 0, count }, ray.t_min);
            }
            return;
        };
        let Some(object_ray) = ObjectRay::in_world(ray) else { return };
        if let Some(node_ray) = NodeRay::new(&object_ray, ray.t_max, tree.bounds(), tree.scale()) {
            push(&mut self.open, tree.root(), node_ray.root_entry());
            self.world = Some(node_ray);
        }
    }

    /// Goes on until a candidate waits for its turn; `false` where nothing is left to visit.
    pub(super) fn advance(&mut self, tlas: &Tlas, visit: &mut impl Visit) -> bool {
        loop {
            if let Some(level) = self.level.take() {
                self.visit_level(tlas, &level, visit);
                if self.open.len() > level.base {
                    self.level = Some(level);
                } else {
                    self.spare_level = Some(level);
                }
            } else {
                let Some(Open { child, entry, .. }) = self.open.pop() else { return false };
                if entry <= self.cull_t {
                    self.step_in_world(tlas, child, entry, visit);
                }
            }
            if self.has_waiting() {
                return true;
            }
        }
    }

    /// Visits what the stack holds of a BLAS, until a candidate waits.
    fn visit_level<V: Visit>(&mut self, tlas: &Tlas, level: &Level, visit: &mut V) {
        #[cfg(target_arch = "x86_64")]
        if !V::REASONS
            && let Some(simd) = tlas.simd()
        {
            return simd.vectorize(VisitLevel { cursor: self, tlas, level, visit, simd });
        }
        self.visit_level_with(TwoFours, tlas, level, visit);
    }

    #[inline(always)]
    fn visit_level_with<E: Eights, V: Visit>(
        &mut self,
        eights: E,
        tlas: &Tlas,
        level: &Level,
        visit: &mut V,
    ) {
        let body = tlas.instances()[level.instance as usize].blas.body();
        let Some(tree) = body.tree() else { return };
        let slabs = level.node_ray.slabs(eights);
        let mut limit = level.node_ray.limit(self.cull_t);
        while self.open.len() > level.base {
            let Some(Open { mut child, entry, .. }) = self.open.pop() else { return };
            if entry > self.cull_t {
                continue;
            }
            // Down to a leaf; what is farther waits on the stack.
            loop {
                if child.count > 0 {
                    let (ray, block_ray) = (&level.object_ray, level.block_ray.as_ref());
                    self.test(tlas, level.instance, body, child, ray, block_ray, visit);
                    if self.has_waiting() {
                        return;
                    }
                    limit = level.node_ray.limit(self.cull_t);
                    break;
                }
                visit.node(Some(level.instance));
                let node = tree.node(child.first);
                match push_children(&mut self.open, limit, node, (&level.node_ray, &slabs)) {
                    Some((nearest, _)) => child = nearest,
                    None => break,
                }
            }
        }
    }

    fn step_in_world(&mut self, tlas: &Tlas, child: Child, entry: f32, visit: &mut impl Visit) {
        match (child.count, tlas.tree()) {
            (0, Some((tree, _))) => {
                let Some(world) = &self.world else { return };
                visit.node(None);
                let limit = world.limit(self.cull_t);
                let slabs = world.slabs(TwoFours);
                if let Some((nearest, entry)) =
                    push_children(&mut self.open, limit, tree.node(child.first), (world, &slabs))
                {
                    push(&mut self.open, nearest, entry);
                }
            }
            (1, tree) => {
                let instance = tree.map_or(child.first, |(_, order)| order[child.first as usize]);
                let verdict = self.enter(tlas, instance, visit);
                visit.instance(instance, verdict);
            }
            (count, _) => {
                // The lowest place is looked at first.
                for place in (child.first..child.first + count).rev() {
                    push(&mut self.open, Child { first: place, count: 1 }, entry);
                }
            }
        }
    }

    /// Goes into an instance: its primitives are tested at once where they are few, otherwise the
    /// root of its tree comes on the stack.
    fn enter<V: Visit>(&mut self, tlas: &Tlas, number: u32, visit: &mut V) -> InstanceVerdict {
        let instance = &tlas.instances()[number as usize];
        if !is_visible(instance.mask, self.trace.cull_mask) {
            return InstanceVerdict::Masked;
        }
        if instance.blas.kind().is_some_and(|kind| is_skipped(self.trace.flags, kind)) {
            return InstanceVerdict::Skipped;
        }
        let mut level = self.spare_level.take().unwrap_or_else(|| Box::new(Level::IDLE));
        if !tlas.set_object_ray(number, &self.trace.ray, self.trace.time, &mut level.object_ray) {
            self.spare_level = Some(level);
            return InstanceVerdict::Missed;
        }
        let verdict = self.enter_body(tlas, number, &mut level, visit);
        let goes_on = verdict == InstanceVerdict::Entered && self.open.len() > level.base;
        *(if goes_on { &mut self.level } else { &mut self.spare_level }) = Some(level);
        verdict
    }

    /// Goes into an instance with the ray in its space.
    #[inline(always)]
    fn enter_body<V: Visit>(
        &mut self,
        tlas: &Tlas,
        number: u32,
        level: &mut Level,
        visit: &mut V,
    ) -> InstanceVerdict {
        let body = tlas.instances()[number as usize].blas.body();
        level.base = self.open.len();
        let ray = &level.object_ray;
        let Some(tree) = body.tree() else {
            let all = body.all();
            if all.count > 0 {
                self.test_few(tlas, number, body, all, ray, visit);
            }
            return InstanceVerdict::Entered;
        };
        if V::REASONS && NodeRay::misses(ray, self.cull_t, tree.bounds()) {
            return InstanceVerdict::Missed;
        }
        let Some(node_ray) = NodeRay::new(ray, self.cull_t, tree.bounds(), tree.scale()) else {
            return InstanceVerdict::Missed;
        };
        level.instance = number;
        level.block_ray = body.block_ray(ray);
        level.node_ray = node_ray;
        push(&mut self.open, tree.root(), node_ray.root_entry());
        InstanceVerdict::Entered
    }

    /// Tests the primitives of an instance without a tree.
    #[inline(never)]
    fn test_few<V: Visit>(
        &mut self,
        tlas: &Tlas,
        number: u32,
        body: &Body,
        all: Child,
        ray: &ObjectRay,
        visit: &mut V,
    ) {
        self.test(tlas, number, body, all, ray, None, visit);
    }

    /// Tests a leaf of an instance.
    #[allow(clippy::too_many_arguments)]
    #[inline(always)]
    fn test<V: Visit>(
        &mut self,
        tlas: &Tlas,
        number: u32,
        body: &Body,
        leaf: Child,
        ray: &ObjectRay,
        block_ray: Option<&BlockRay>,
        visit: &mut V,
    ) {
        let mut rest = if V::REASONS { body.every(leaf) } else { body.met(leaf, block_ray) };
        visit.missed(leaf.count - rest.count_ones());
        if rest == 0 {
            return;
        }
        let instance = &tlas.instances()[number as usize];
        let flags = self.trace.flags;
        let common = body.common_flags();
        while rest != 0 {
            let at = leaf.first as usize + rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let name = body.name(at);
            let place = Place { instance: number, geometry: name.geometry, primitive: name.primitive };
            let (geometry_flags, micromap) = match common {
                Some(flags) => (flags, None),
                None => {
                    let geometry = &instance.blas.geometries()[name.geometry as usize];
                    let enabled = !instance.flags.contains(InstanceFlags::DISABLE_OPACITY_MICROMAPS);
                    (geometry.flags, geometry.opacity_micromap.as_deref().filter(|_| enabled))
                }
            };
            let mut opaque = is_opaque(flags, instance.flags, geometry_flags);
            let mut culled = is_culled_by_opacity(flags, opaque);
            if culled && micromap.is_none() && !V::REASONS {
                continue;
            }
            let Some(found) = body.intersect(at, ray, self.trace.time, tlas.precision()) else {
                let verdict = if V::REASONS {
                    missed_or_outside(tlas, place, body, at, ray, self.trace.time)
                } else {
                    PrimitiveVerdict::Missed
                };
                visit.primitive(place, verdict);
                continue;
            };
            let found = Intersection { surface: presented(found.surface, instance.flags), ..found };
            if let Some(micromap) = micromap {
                let opacity = micromap.opacity(name.primitive, found.attributes);
                let Some(of_part) = opacity.is_opaque(is_two_state(flags, instance.flags)) else {
                    visit.primitive(place, PrimitiveVerdict::Transparent(found));
                    continue;
                };
                let of_part = if of_part { GeometryFlags::OPAQUE } else { GeometryFlags::default() };
                opaque = is_opaque(flags, instance.flags, of_part);
                culled = is_culled_by_opacity(flags, opaque);
            }
            let verdict = if culled {
                PrimitiveVerdict::CulledByOpacity(found)
            } else if is_culled_by_face(flags, instance.flags, found.surface) {
                PrimitiveVerdict::CulledByFace(found)
            } else {
                self.take(Candidate {
                    instance: number,
                    geometry: name.geometry,
                    primitive: name.primitive,
                    intersection: found,
                    opaque,
                })
            };
            visit.primitive(place, verdict);
        }
    }

    #[inline(always)]
    fn take(&mut self, candidate: Candidate) -> PrimitiveVerdict {
        let found = candidate.intersection;
        if candidate.opaque && !candidate.is_box() {
            if self.take_opaque(candidate) {
                return PrimitiveVerdict::Opaque(found);
            }
        } else if self.take_candidate(candidate) {
            return PrimitiveVerdict::Candidate(found);
        }
        PrimitiveVerdict::Behind(found)
    }
}

#[inline(always)]
fn push(open: &mut Vec<Open>, child: Child, entry: f32) {
    let floor = open.last().map_or(entry, |below| if below.floor < entry { below.floor } else { entry });
    open.push(Open { child, entry, floor });
}

/// The nearest of the children that the ray meets, with its entry; the others come on the stack, the
/// nearest of them on top.
#[inline(always)]
fn push_children<E: Eights>(
    open: &mut Vec<Open>,
    limit: NodeLimit,
    node: &Node,
    (ray, slabs): (&NodeRay, &Slabs<E>),
) -> Option<(Child, f32)> {
    let (near, mut rest) = node.entries(slabs, limit);
    if rest == 0 {
        return None;
    }
    let mut next = || {
        let slot = rest.trailing_zeros() as usize % WIDTH;
        rest &= rest - 1;
        (rest != 0, (ray.absolute(near[slot]), slot))
    };
    let (more, first) = next();
    if !more {
        return Some((node.child(first.1), first.0));
    }
    // Most nodes leave one child or two.
    let (more, second) = next();
    let (mut nearest, other) = if second.0 < first.0 { (second, first) } else { (first, second) };
    if !more {
        push(open, node.child(other.1), other.0);
        return Some((node.child(nearest.1), nearest.0));
    }
    // Insertion, the farthest first.
    let mut met = [(0.0f32, 0usize); WIDTH];
    met[0] = other;
    let mut count = 1;
    loop {
        let (more, mut one) = next();
        if one.0 < nearest.0 {
            std::mem::swap(&mut one, &mut nearest);
        }
        let mut at = count;
        while at > 0 && met[at - 1].0 < one.0 {
            met[at] = met[at - 1];
            at -= 1;
        }
        met[at] = one;
        count += 1;
        if !more {
            break;
        }
    }
    for &(entry, slot) in &met[..count] {
        push(open, node.child(slot), entry);
    }
    Some((node.child(nearest.1), nearest.0))
}

/// A visit with its arguments, to be compiled for AVX2: the same operations, and the same results.
#[cfg(target_arch = "x86_64")]
struct VisitLevel<'a, V> {
    cursor: &'a mut Cursor,
    tlas: &'a Tlas,
    level: &'a Level,
    visit: &'a mut V,
    simd: V3,
}

#[cfg(target_arch = "x86_64")]
impl<V: Visit> pulp::NullaryFnOnce for VisitLevel<'_, V> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.cursor.visit_level_with(self.simd, self.tlas, self.level, self.visit);
    }
}

/// Why a primitive was not hit: tests it again over all t >= 0.
#[cold]
fn missed_or_outside(
    tlas: &Tlas,
    place: Place,
    body: &Body,
    at: usize,
    ray: &ObjectRay,
    time: f32,
) -> PrimitiveVerdict {
    let whole = ray.world().with_interval(0.0, f32::INFINITY);
    tlas.object_ray(place.instance, &whole, time)
        .and_then(|whole| body.intersect(at, &whole, time, tlas.precision()))
        .map_or(PrimitiveVerdict::Missed, PrimitiveVerdict::OutsideInterval)
}
