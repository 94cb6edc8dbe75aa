//! The traversal loop that all contenders share.

use anyhit::geometry::Ray;
use anyhit::math::lane_ops::{LaneOps, LaneTask};

use crate::contender::{Contender, Placed};
use crate::scene::Scene;
use crate::shape::Shape;
use crate::tree::{Corners, Leaves, TravRay, Tree};

/// t, instance, primitive.
pub type Hit = Option<(f32, u32, u32)>;

/// What all contenders have in common of a scene.
pub struct Trees {
    pub primitives: Tree,
    /// Over the placed ones, where they are several.
    instances: Option<Tree>,
    pub placed: Vec<(Placed, Corners)>,
}

impl Trees {
    pub fn of(scene: &Scene) -> Self {
        let corners: Vec<_> = scene.shapes.iter().map(Shape::corners).collect();
        let placed = scene.placed();
        let around: Vec<_> = placed.iter().map(|(_, corners)| *corners).collect();
        let instances = (placed.len() > 1).then(|| Tree::build(&around));
        Self { primitives: Tree::build(&corners), instances, placed }
    }
}

/// A scene as one contender has it.
pub struct Field<'a, C: Contender> {
    pub scene: &'a Scene,
    pub trees: &'a Trees,
    pub blocks: Vec<C::Block>,
}

impl<'a, C: Contender> Field<'a, C> {
    pub fn new(scene: &'a Scene, trees: &'a Trees) -> Self {
        let block = |numbers: &Vec<u32>| {
            C::block(&numbers.iter().map(|&number| scene.shapes[number as usize]).collect::<Vec<_>>())
        };
        Self { scene, trees, blocks: trees.primitives.blocks.iter().map(block).collect() }
    }
}

/// Some rays, all that they do compiled for the same vectors.
pub struct Pass<'a, C: Contender> {
    pub field: &'a Field<'a, C>,
    pub rays: &'a [Ray],
    pub hits: &'a mut Vec<Hit>,
}

impl<C: Contender> LaneTask for Pass<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run<V: LaneOps>(self, simd: V) {
        let field = self.field;
        let mut prepared = C::EMPTY;
        for ray in self.rays {
            let mut way = Way { field, ray, prepared: &mut prepared, best: None };
            match &field.trees.instances {
                None => {
                    way.enter(simd, 0, ray.t_max);
                }
                Some(instances) => {
                    let nodes = TravRay::new(ray.origin, ray.direction);
                    instances.traverse(simd, &nodes, ray.t_max, &mut InWorld { way: &mut way, instances });
                }
            }
            self.hits.push(way.best);
        }
    }
}

/// A ray's way.
struct Way<'a, C: Contender> {
    field: &'a Field<'a, C>,
    ray: &'a Ray,
    prepared: &'a mut C::Ready,
    best: Hit,
}

impl<C: Contender> Way<'_, C> {
    /// Through an instance; returns the new limit.
    #[inline(always)]
    fn enter<V: LaneOps>(&mut self, simd: V, instance: u32, limit: f32) -> f32 {
        let Field { scene, trees, .. } = self.field;
        let placed = &trees.placed[instance as usize].0;
        C::ready(self.prepared, self.ray, placed, &scene.bounds);
        let nodes = TravRay::in_object(self.ray, placed);
        trees.primitives.traverse(simd, &nodes, limit, &mut InInstance { way: self, instance, placed })
    }
}

/// Its leaves are instances.
struct InWorld<'a, 'b, C: Contender> {
    way: &'a mut Way<'b, C>,
    instances: &'a Tree,
}

impl<C: Contender> Leaves for InWorld<'_, '_, C> {
    #[inline(always)]
    fn visit<V: LaneOps>(&mut self, simd: V, block: usize, mut limit: f32) -> f32 {
        for &instance in &self.instances.blocks[block] {
            limit = self.way.enter(simd, instance, limit);
        }
        limit
    }
}

/// Its leaves are blocks of primitives.
struct InInstance<'a, 'b, C: Contender> {
    way: &'a mut Way<'b, C>,
    instance: u32,
    placed: &'a Placed,
}

impl<C: Contender> Leaves for InInstance<'_, '_, C> {
    #[inline(always)]
    fn visit<V: LaneOps>(&mut self, simd: V, block: usize, mut limit: f32) -> f32 {
        let Way { field, ray, prepared, best } = &mut *self.way;
        let numbers = &field.trees.primitives.blocks[block];
        let block = &field.blocks[block];
        let mut met = C::maybe_hit_mask(simd, block, prepared) & ((1 << numbers.len()) - 1);
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            if let Some(t) = C::hit(simd, (block, lane), prepared, (ray, self.placed)) {
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
