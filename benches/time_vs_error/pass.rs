//! The traversal loop that all contenders share.

use anyhit_engine::geometry::Ray;
use anyhit_engine::math::lane_ops::{LaneOps, LaneTask};

use crate::contender::{Contender, PlacedInstance};
use crate::scene::Scene;
use crate::shape::{Corners, Shape};
use crate::tree::{Bvh, LeafVisitor, TravRay};

/// The t, the instance and the primitive of a hit.
pub type Hit = Option<(f32, u32, u32)>;

/// The BVHs of a scene, which all contenders share.
pub struct SceneBvhs {
    pub primitives: Bvh,
    /// The BVH over the instances, if there are several.
    instances: Option<Bvh>,
    pub placed: Vec<(PlacedInstance, Corners)>,
}

impl SceneBvhs {
    pub fn of(scene: &Scene) -> Self {
        let corners: Vec<_> = scene.shapes.iter().map(Shape::corners).collect();
        let placed = scene.placed();
        let around: Vec<_> = placed.iter().map(|(_, corners)| *corners).collect();
        let instances = (placed.len() > 1).then(|| Bvh::build(&around));
        Self { primitives: Bvh::build(&corners), instances, placed }
    }
}

/// A scene with the blocks of one contender.
pub struct ContenderScene<'a, C: Contender> {
    pub scene: &'a Scene,
    pub trees: &'a SceneBvhs,
    pub blocks: Vec<C::Block>,
}

impl<'a, C: Contender> ContenderScene<'a, C> {
    pub fn new(scene: &'a Scene, trees: &'a SceneBvhs) -> Self {
        let block = |numbers: &Vec<u32>| {
            C::block(&numbers.iter().map(|&number| scene.shapes[number as usize]).collect::<Vec<_>>())
        };
        Self { scene, trees, blocks: trees.primitives.blocks.iter().map(block).collect() }
    }
}

/// The traversal of some rays, compiled as a whole for one instruction set.
pub struct TracePass<'a, C: Contender> {
    pub field: &'a ContenderScene<'a, C>,
    pub rays: &'a [Ray],
    pub hits: &'a mut Vec<Hit>,
}

impl<C: Contender> LaneTask for TracePass<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run<V: LaneOps>(self, simd: V) {
        let field = self.field;
        let mut prepared = C::EMPTY;
        for ray in self.rays {
            let mut traversal = RayTraversal { field, ray, prepared: &mut prepared, best: None };
            match &field.trees.instances {
                None => {
                    traversal.enter(simd, 0, ray.t_max);
                }
                Some(instances) => {
                    let nodes = TravRay::new(ray.origin, ray.direction);
                    instances.traverse(
                        simd,
                        &nodes,
                        ray.t_max,
                        &mut TlasLeaves { traversal: &mut traversal, instances },
                    );
                }
            }
            self.hits.push(traversal.best);
        }
    }
}

/// The traversal of one ray.
struct RayTraversal<'a, C: Contender> {
    field: &'a ContenderScene<'a, C>,
    ray: &'a Ray,
    prepared: &'a mut C::PreparedRay,
    best: Hit,
}

impl<C: Contender> RayTraversal<'_, C> {
    /// Traverses an instance; returns the new limit.
    #[inline(always)]
    fn enter<V: LaneOps>(&mut self, simd: V, instance: u32, limit: f32) -> f32 {
        let ContenderScene { scene, trees, .. } = self.field;
        let placed = &trees.placed[instance as usize].0;
        C::prepare(self.prepared, self.ray, placed, &scene.bounds);
        let nodes = TravRay::in_object(self.ray, placed);
        trees.primitives.traverse(simd, &nodes, limit, &mut BlasLeaves { traversal: self, instance, placed })
    }
}

/// Visits the leaves of the BVH over the instances.
struct TlasLeaves<'a, 'b, C: Contender> {
    traversal: &'a mut RayTraversal<'b, C>,
    instances: &'a Bvh,
}

impl<C: Contender> LeafVisitor for TlasLeaves<'_, '_, C> {
    #[inline(always)]
    fn visit<V: LaneOps>(&mut self, simd: V, block: usize, mut limit: f32) -> f32 {
        for &instance in &self.instances.blocks[block] {
            limit = self.traversal.enter(simd, instance, limit);
        }
        limit
    }
}

/// Visits the leaves of an instance, which are blocks of primitives.
struct BlasLeaves<'a, 'b, C: Contender> {
    traversal: &'a mut RayTraversal<'b, C>,
    instance: u32,
    placed: &'a PlacedInstance,
}

impl<C: Contender> LeafVisitor for BlasLeaves<'_, '_, C> {
    #[inline(always)]
    fn visit<V: LaneOps>(&mut self, simd: V, block: usize, mut limit: f32) -> f32 {
        let RayTraversal { field, ray, prepared, best } = &mut *self.traversal;
        let numbers = &field.trees.primitives.blocks[block];
        let block = &field.blocks[block];
        let mut maybe_hit = C::maybe_hit_mask(simd, block, prepared) & ((1 << numbers.len()) - 1);
        while maybe_hit != 0 {
            let lane = maybe_hit.trailing_zeros() as usize;
            maybe_hit &= maybe_hit - 1;
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
