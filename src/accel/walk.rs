//! One step of a traversal through the trees of a TLAS and its BLASes.

use crate::accel::blas::GeometryFlags;
use crate::accel::body::Body;
use crate::accel::cursor::{Candidate, Cursor};
use crate::accel::micromap::is_two_state;
use crate::accel::node::{Child, Node, WIDTH};
use crate::accel::node_ray::{NodeLimit, NodeRay};
use crate::accel::rules::{
    is_culled_by_face, is_culled_by_opacity, is_opaque, is_skipped, is_visible, presented,
};
use crate::accel::tlas::{InstanceFlags, Tlas};
use crate::accel::visit::{InstanceVerdict, Place, PrimitiveVerdict, Visit};
use crate::geometry::block::BlockRay;
use crate::geometry::{Intersection, ObjectRay};

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

impl Cursor {
    /// Puts the root on the stack.
    pub(super) fn start(&mut self, tlas: &Tlas) {
        self.open.clear();
        self.level = None;
        self.world = None;
        let ray = &self.trace.ray;
        let Some(object_ray) = ObjectRay::in_world(ray) else { return };
        let Some((tree, _)) = tlas.tree() else {
            let count = tlas.instances().len() as u32;
            if count > 0 {
                push(&mut self.open, Child { first: 0, count }, ray.t_min);
            }
            return;
        };
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
    fn visit_level(&mut self, tlas: &Tlas, level: &Level, visit: &mut impl Visit) {
        let body = tlas.instances()[level.instance as usize].blas.body();
        let Some(tree) = body.tree() else { return };
        let mut limit = level.node_ray.limit(self.cull_t);
        while self.open.len() > level.base {
            let Some(Open { mut child, entry, .. }) = self.open.pop() else { return };
            if entry > self.cull_t {
                continue;
            }
            // Down to a leaf; what is farther waits on the stack.
            loop {
                if child.count > 0 {
                    self.test(
                        tlas,
                        level.instance,
                        body,
                        child,
                        &level.object_ray,
                        level.block_ray.as_ref(),
                        visit,
                    );
                    if self.has_waiting() {
                        return;
                    }
                    limit = level.node_ray.limit(self.cull_t);
                    break;
                }
                visit.node(Some(level.instance));
                match push_children(&mut self.open, limit, tree.node(child.first), &level.node_ray) {
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
                if let Some((nearest, entry)) =
                    push_children(&mut self.open, limit, tree.node(child.first), world)
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
        let Some(object_ray) = tlas.object_ray(number, &self.trace.ray, self.trace.time) else {
            return InstanceVerdict::Missed;
        };
        let body = instance.blas.body();
        let Some(tree) = body.tree() else {
            let all = body.all();
            if all.count > 0 {
                self.test(tlas, number, body, all, &object_ray, None, visit);
            }
            return InstanceVerdict::Entered;
        };
        if V::REASONS && NodeRay::misses(&object_ray, self.cull_t, tree.bounds()) {
            return InstanceVerdict::Missed;
        }
        let Some(node_ray) = NodeRay::new(&object_ray, self.cull_t, tree.bounds(), tree.scale()) else {
            return InstanceVerdict::Missed;
        };
        let entry = node_ray.root_entry();
        let block_ray = body.block_ray(&object_ray);
        let level = Level { instance: number, base: self.open.len(), object_ray, node_ray, block_ray };
        self.level = Some(match self.spare_level.take() {
            Some(mut spare) => {
                *spare = level;
                spare
            }
            None => Box::new(level),
        });
        push(&mut self.open, tree.root(), entry);
        InstanceVerdict::Entered
    }

    /// Tests a leaf of an instance.
    #[allow(clippy::too_many_arguments)]
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
        while rest != 0 {
            let at = leaf.first as usize + rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let name = body.name(at);
            let place = Place { instance: number, geometry: name.geometry, primitive: name.primitive };
            let geometry = &instance.blas.geometries()[name.geometry as usize];
            let micromap = geometry
                .opacity_micromap
                .as_deref()
                .filter(|_| !instance.flags.contains(InstanceFlags::DISABLE_OPACITY_MICROMAPS));
            let mut opaque = is_opaque(flags, instance.flags, geometry.flags);
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

    #[inline]
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

#[inline]
fn push(open: &mut Vec<Open>, child: Child, entry: f32) {
    let floor = open.last().map_or(entry, |below| if below.floor < entry { below.floor } else { entry });
    open.push(Open { child, entry, floor });
}

/// The nearest of the children that the ray meets, with its entry; the others come on the stack, the
/// nearest of them on top.
#[inline(always)]
fn push_children(open: &mut Vec<Open>, limit: NodeLimit, node: &Node, ray: &NodeRay) -> Option<(Child, f32)> {
    let (near, mut rest) = node.entries(ray, limit);
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
