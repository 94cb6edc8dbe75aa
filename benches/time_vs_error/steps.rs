//! Counts the step at which the tests of the exact mode end: culling, filter or exact arithmetic.

use anyhit_engine::geometry::{ObjectRay, aabb, block, linear_swept_sphere, sphere, triangle};
use anyhit_engine::math::lane_ops::{CpuTier, LaneOps, LaneTask};

use crate::contender::{Contender, EXACT, ExactTriangles, Ours};
use crate::pass::{ContenderScene, SceneBvhs};
use crate::scene::Scene;
use crate::shape::Shape;
use crate::tree::{LeafVisitor, TravRay};

/// Describes the shares of the steps, over all leaves that rays reach in all instances.
pub fn steps(scene: &Scene, trees: &SceneBvhs) -> String {
    let cpu_tier = CpuTier::new();
    let counts = match scene.shapes[0] {
        Shape::Sphere(..) => {
            cpu_tier.run(Count(ContenderScene::<Ours<block::Sphere4, EXACT>>::new(scene, trees)))
        }
        Shape::Swept(..) => {
            cpu_tier.run(Count(ContenderScene::<Ours<block::LinearSweptSphere4, EXACT>>::new(scene, trees)))
        }
        Shape::Triangle(_) => cpu_tier.run(Count(ContenderScene::<ExactTriangles>::new(scene, trees))),
        Shape::Aabb(_) => cpu_tier.run(Count(ContenderScene::<Ours<block::Aabb4, EXACT>>::new(scene, trees))),
    };
    let total = counts.iter().sum::<u64>();
    let [in_f32, in_f64, exactly] = counts.map(|count| 100.0 * count as f64 / total.max(1) as f64);
    format!("of {total} tests {in_f32:.2} % end in f32, {in_f64:.2} % in f64, {exactly:.4} % exactly")
}

/// Counts the tests that end in f32, in f64 and exactly.
struct Count<'a, C: Contender>(ContenderScene<'a, C>);

impl<C: Contender> LaneTask for Count<'_, C> {
    type Output = [u64; 3];

    fn run<V: LaneOps>(self, simd: V) -> [u64; 3] {
        let Self(field) = self;
        let ContenderScene { scene, trees, .. } = &field;
        let mut counts = [0; 3];
        let mut prepared = C::EMPTY;
        for ray in &scene.rays {
            for (placed, _) in &trees.placed {
                C::prepare(&mut prepared, ray, placed, &scene.bounds);
                let nodes = TravRay::in_object(ray, placed);
                let mut tests = Tests {
                    field: &field,
                    prepared: &prepared,
                    object: placed.object(ray),
                    counts: &mut counts,
                };
                trees.primitives.traverse(simd, &nodes, f32::INFINITY, &mut tests);
            }
        }
        counts
    }
}

/// The tests of a ray in an instance.
struct Tests<'a, C: Contender> {
    field: &'a ContenderScene<'a, C>,
    prepared: &'a C::PreparedRay,
    object: ObjectRay,
    counts: &'a mut [u64; 3],
}

impl<C: Contender> LeafVisitor for Tests<'_, C> {
    fn visit<V: LaneOps>(&mut self, simd: V, block: usize, limit: f32) -> f32 {
        let ContenderScene { scene, trees, blocks } = self.field;
        let maybe_hit = C::maybe_hit_mask(simd, &blocks[block], self.prepared);
        for (lane, &number) in trees.primitives.blocks[block].iter().enumerate() {
            let step = match maybe_hit >> lane & 1 {
                0 => 0,
                _ if is_decided_in_f64(&scene.shapes[number as usize], &self.object) => 1,
                _ => 2,
            };
            self.counts[step] += 1;
        }
        limit
    }
}

fn is_decided_in_f64(shape: &Shape, ray: &ObjectRay) -> bool {
    match *shape {
        Shape::Sphere(center, radius) => sphere::is_decided_in_f64(ray, center, radius),
        Shape::Swept(positions, radii) => {
            linear_swept_sphere::is_decided_in_f64(ray, positions, radii, [true; 2])
        }
        Shape::Triangle(vertices) => triangle::is_decided_in_f64(ray, vertices),
        Shape::Aabb([min, max]) => aabb::is_decided_in_f64(ray, min, max),
    }
}
