//! What is compared: this crate in its three precisions, and formulas as they are published, in
//! plain f32. Every contender has a test of a block of four and a test of one lane that passed it.

use anyhit::geometry::block::{self, BlockRay, BoxRay};
use anyhit::geometry::triangle::FourTested;
use anyhit::geometry::{Bounds, DoubleRay, ObjectRay, Precision, Ray, Transform};
use anyhit::math::vectors::Vectors;

use crate::shape::Shape;

/// An instance: for this crate its exact transform, for the others the inverse in f32.
pub struct Placed {
    pub transform: Option<Transform>,
    pub inverse: [[f32; 4]; 3],
}

/// One way to intersect.
pub trait Contender {
    /// Four primitives.
    type Block;
    /// The ray in object space.
    type Ray: Copy;
    /// What the test of four already knows of the lanes.
    type Known: Copy;
    /// Memory for a ray.
    const IDLE: Self::Ray;

    fn block(shapes: &[Shape]) -> Self::Block;
    /// Brings a ray into object space.
    fn ready(out: &mut Self::Ray, ray: &Ray, placed: &Placed, around: &Bounds);
    /// A bit for each lane that may be hit, up to `limit`.
    fn met<V: Vectors>(vectors: V, block: &Self::Block, ray: &Self::Ray, limit: f32) -> (u32, Self::Known);
    /// The t of a lane.
    fn hit(block: &Self::Block, lane: usize, ray: &mut Self::Ray, known: &Self::Known) -> Option<f32>;
}

/// This crate.
pub struct Ours<K, const PRECISION: u8>(std::marker::PhantomData<K>);

pub const FLOAT: u8 = 0;
pub const DOUBLE: u8 = 1;
pub const EXACT: u8 = 2;

const fn precision(number: u8) -> Precision {
    match number {
        FLOAT => Precision::Float,
        DOUBLE => Precision::Double,
        _ => Precision::Exact,
    }
}

macro_rules! ours {
    ($block:ty, $met:ident, $block_ray:ident, $shape:pat => $block_name:ident, $lane:ident, $set:expr $(, $caps:expr)?) => {
        impl<const P: u8> Contender for Ours<$block, P> {
            type Block = $block;
            type Ray = (ObjectRay, $block_ray);
            type Known = ();
            const IDLE: Self::Ray = (ObjectRay::IDLE, $block_ray::IDLE);

            fn block(shapes: &[Shape]) -> Self::Block {
                let mut $block_name = <$block>::EMPTY;
                for ($lane, shape) in shapes.iter().enumerate() {
                    let $shape = *shape else { panic!("a BLAS of two kinds") };
                    $set;
                }
                $block_name
            }

            #[inline(always)]
            fn ready(out: &mut Self::Ray, ray: &Ray, placed: &Placed, around: &Bounds) {
                set(&mut out.0, ray, placed);
                out.1 = $block_ray::prepared(ray, &out.0, around);
            }

            #[inline(always)]
            fn met<V: Vectors>(_: V, block: &Self::Block, ray: &Self::Ray, _: f32) -> (u32, ()) {
                (block.$met(&ray.1), ())
            }

            #[inline(always)]
            fn hit(block: &Self::Block, lane: usize, ray: &mut Self::Ray, (): &()) -> Option<f32> {
                block.intersect(lane, $($caps,)? &ray.0, precision(P)).map(|hit| hit.t)
            }
        }
    };
}

ours!(block::Spheres, entered, BlockRay, Shape::Sphere(center, radius) => block, lane, block.set(lane, center, radius));
ours!(block::SweptEnds, met, BlockRay, Shape::Swept(positions, radii) => block, lane,
    block.set(lane, positions, radii), &[[true; 2]; block::LANES]);
ours!(block::Triangles, met, BlockRay, Shape::Triangle(vertices) => block, lane, block.set(lane, vertices));
ours!(block::Aabbs, met, BoxRay, Shape::Aabb([min, max]) => block, lane, block.set(lane, min, max));

/// A ray made ready for blocks.
trait ForBlocks {
    fn prepared(ray: &Ray, object: &ObjectRay, around: &Bounds) -> Self;
}

impl ForBlocks for BlockRay {
    #[inline(always)]
    fn prepared(ray: &Ray, object: &ObjectRay, around: &Bounds) -> Self {
        let simple = if object.is_in_world() { Self::simple(ray, around) } else { None };
        simple.unwrap_or_else(|| Self::new(object, around))
    }
}

impl ForBlocks for BoxRay {
    #[inline(always)]
    fn prepared(_: &Ray, object: &ObjectRay, around: &Bounds) -> Self {
        Self::new(object, around)
    }
}

/// This crate's exact triangles, as the traversal that shaders get tests them: all of a block at once.
pub struct InFours;

/// Its ray. What exact arithmetic would need comes with the first test that asks for it.
#[derive(Clone, Copy)]
pub struct DoubleRays {
    double: DoubleRay,
    /// In world space, where the ray in object space is not made yet.
    world: Option<Ray>,
    object: ObjectRay,
}

impl Contender for InFours {
    type Block = block::Triangles;
    type Ray = DoubleRays;
    type Known = FourTested;
    const IDLE: Self::Ray = DoubleRays { double: DoubleRay::IDLE, world: None, object: ObjectRay::IDLE };

    fn block(shapes: &[Shape]) -> Self::Block {
        Ours::<block::Triangles, EXACT>::block(shapes)
    }

    #[inline(always)]
    fn ready(out: &mut Self::Ray, ray: &Ray, placed: &Placed, _: &Bounds) {
        if placed.transform.is_none() && ray.is_ordinary() {
            (out.double, out.world) = (DoubleRay::ordinary(ray), Some(*ray));
        } else {
            set(&mut out.object, ray, placed);
            (out.double, out.world) = (DoubleRay::of(&out.object), None);
        }
    }

    #[inline(always)]
    fn met<V: Vectors>(vectors: V, block: &Self::Block, ray: &Self::Ray, limit: f32) -> (u32, FourTested) {
        let tested = block.tested(vectors, &ray.double, limit);
        (tested.met(), tested)
    }

    #[inline(always)]
    fn hit(block: &Self::Block, lane: usize, ray: &mut Self::Ray, known: &FourTested) -> Option<f32> {
        let hit = match known.hit(lane) {
            None => {
                if let Some(world) = ray.world.take() {
                    assert!(ray.object.set_in_world(&world), "a finite ray");
                }
                block.intersect(lane, &ray.object, Precision::Exact)
            }
            hit => hit,
        };
        hit.map(|hit| hit.t)
    }
}

/// Brings a ray into object space.
#[inline(always)]
fn set(out: &mut ObjectRay, ray: &Ray, placed: &Placed) {
    let is_ray = match &placed.transform {
        Some(transform) => out.set_in_instance(ray, transform),
        None => out.set_in_world(ray),
    };
    assert!(is_ray, "a finite ray");
}
