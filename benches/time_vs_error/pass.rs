//! One contender's way through a scene: the loop that all share.

use anyhit::geometry::{Bounds, Ray};
use anyhit::math::vectors::{Task, Vectors};

use crate::contender::{Contender, Placed};
use crate::tree::{Corners, Leaves, NodeRay, Tree};

/// t, instance, primitive.
pub type Hit = Option<(f32, u32, u32)>;

/// A scene as one contender has it.
pub struct Field<C: Contender> {
    pub tree: Tree,
    pub blocks: Vec<C::Block>,
    /// Of the tree.
    pub bounds: Bounds,
    pub placed: Vec<(Placed, Corners)>,
    /// A tree of the placed ones, where they are several.
    pub instances: Option<Tree>,
}

/// Some rays, all that they do compiled for the same vectors.
pub struct Pass<'a, C: Contender> {
    pub field: &'a Field<C>,
    pub rays: &'a [Ray],
    pub hits: &'a mut Vec<Hit>,
}

impl<C: Contender> Task for Pass<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) {
        let field = self.field;
        let mut prepared = C::IDLE;
        for ray in self.rays {
            let mut way = Way { field, ray, prepared: &mut prepared, best: None };
            match &field.instances {
                None => {
                    way.enter(vectors, 0, ray.t_max);
                }
                Some(instances) => {
                    let nodes = NodeRay::new(ray.origin, ray.direction);
                    instances.traverse(vectors, &nodes, ray.t_max, &mut InWorld { way: &mut way, instances });
                }
            }
            self.hits.push(way.best);
        }
    }
}

/// A ray's way.
struct Way<'a, C: Contender> {
    field: &'a Field<C>,
    ray: &'a Ray,
    prepared: &'a mut C::Ray,
    best: Hit,
}

impl<C: Contender> Way<'_, C> {
    /// Through an instance; returns the new limit.
    #[inline(always)]
    fn enter<V: Vectors>(&mut self, vectors: V, instance: u32, limit: f32) -> f32 {
        let placed = &self.field.placed[instance as usize].0;
        C::ready(self.prepared, self.ray, placed, &self.field.bounds);
        let nodes = NodeRay::in_object(self.ray, placed);
        let tree = &self.field.tree;
        tree.traverse(vectors, &nodes, limit, &mut InInstance { way: self, instance })
    }
}

/// Its leaves are instances.
struct InWorld<'a, 'b, C: Contender> {
    way: &'a mut Way<'b, C>,
    instances: &'a Tree,
}

impl<C: Contender> Leaves for InWorld<'_, '_, C> {
    #[inline(always)]
    fn visit<V: Vectors>(&mut self, vectors: V, block: usize, mut limit: f32) -> f32 {
        for &instance in &self.instances.blocks[block] {
            limit = self.way.enter(vectors, instance, limit);
        }
        limit
    }
}

/// Its leaves are blocks of primitives.
struct InInstance<'a, 'b, C: Contender> {
    way: &'a mut Way<'b, C>,
    instance: u32,
}

impl<C: Contender> Leaves for InInstance<'_, '_, C> {
    #[inline(always)]
    fn visit<V: Vectors>(&mut self, vectors: V, block: usize, mut limit: f32) -> f32 {
        let Way { field, prepared, best, .. } = &mut *self.way;
        let numbers = &field.tree.blocks[block];
        let block = &field.blocks[block];
        let (met, known) = C::met(vectors, block, prepared, limit);
        let mut met = met & ((1 << numbers.len()) - 1);
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            if let Some(t) = C::hit(block, lane, prepared, &known) {
                let key = (t, self.instance, numbers[lane]);
                if best.is_none_or(|best| key < best) {
                    *best = Some(key);
                    limit = t;
                }
            }
        }
        limit
    }
}
