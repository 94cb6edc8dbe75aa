//! What is compared: this crate in its three precisions, and formulas as they are published, in
//! plain f32. Every contender has a test of a block of four and a test of one lane that passed it.

use anyhit::geometry::block::{self, BlockRay, BoxRay, ShearedRay};
use anyhit::geometry::{Bounds, DoubleRay, Intersection, ObjectRay, Precision, Ray, Transform, Verdict};
use anyhit::math::vectors::{Task, Vectors};

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
    /// Memory for one.
    const IDLE: Self::Ray;

    fn block(shapes: &[Shape]) -> Self::Block;
    /// Brings a ray into object space.
    fn ready(out: &mut Self::Ray, ray: &Ray, placed: &Placed, around: &Bounds);
    /// A bit for each lane that may be hit.
    fn met<V: Vectors>(vectors: V, block: &Self::Block, ray: &Self::Ray) -> u32;
    /// The t of a lane. What the ray was made from, a ray in world space and where its primitives are placed, is for what is
    /// made ready seldom.
    fn hit<V: Vectors>(
        vectors: V,
        block: &Self::Block,
        lane: usize,
        ray: &Self::Ray,
        made_from: (&Ray, &Placed),
    ) -> Option<f32>;
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
    ($block:ty, $block_ray:ident, $vectors:ident, $ready:ident => $met:expr, $shape:pat => $block_name:ident, $lane:ident, $set:expr $(, $caps:expr)?) => {
        impl<const P: u8> Contender for Ours<$block, P> {
            type Block = $block;
            type Ray = (ObjectRay, $block_ray);
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
            fn met<V: Vectors>($vectors: V, $block_name: &Self::Block, (_, $ready): &Self::Ray) -> u32 {
                $met
            }

            #[inline(always)]
            fn hit<V: Vectors>(
                _: V,
                block: &Self::Block,
                lane: usize,
                ray: &Self::Ray,
                _: (&Ray, &Placed),
            ) -> Option<f32> {
                block.intersect(lane, $($caps,)? &ray.0, precision(P)).map(|hit| hit.t)
            }
        }
    };
}

ours!(block::Spheres, BlockRay, vectors, ray => block.entered(vectors, ray),
    Shape::Sphere(center, radius) => block, lane, block.set(lane, center, radius));
ours!(block::SweptEnds, BlockRay, vectors, ray => block.met_closely(vectors, ray),
    Shape::Swept(positions, radii) => block, lane, block.set(lane, positions, radii), &[[true; 2]; block::LANES]);
ours!(block::Triangles, ShearedRay, vectors, ray => block.met(vectors, ray),
    Shape::Triangle(vertices) => block, lane, block.set(lane, vertices));
ours!(block::Aabbs, BoxRay, _vectors, ray => block.met(ray),
    Shape::Aabb([min, max]) => block, lane, block.set(lane, min, max));

/// This crate with triangles and exactly, as its traversal has them: no ray in object space where that is
/// the world's, before one is asked for.
pub struct ExactTriangles;

impl Contender for ExactTriangles {
    type Block = block::Triangles;
    /// In f64 where it is not an ordinary one in world space.
    type Ray = (ShearedRay, Option<DoubleRay>);
    const IDLE: Self::Ray = (ShearedRay::IDLE, None);

    fn block(shapes: &[Shape]) -> Self::Block {
        Ours::<block::Triangles, EXACT>::block(shapes)
    }

    #[inline(always)]
    fn ready(out: &mut Self::Ray, ray: &Ray, placed: &Placed, around: &Bounds) {
        *out = if placed.transform.is_none() && ray.is_ordinary() {
            (ShearedRay::ordinary(ray), None)
        } else {
            let object = object_ray(ray, placed);
            (ShearedRay::prepared(ray, &object, around), Some(DoubleRay::of(&object)))
        };
    }

    #[inline(always)]
    fn met<V: Vectors>(vectors: V, block: &Self::Block, (ray, _): &Self::Ray) -> u32 {
        block.met(vectors, ray)
    }

    #[inline(always)]
    fn hit<V: Vectors>(
        vectors: V,
        block: &Self::Block,
        lane: usize,
        (_, ray): &Self::Ray,
        (world, placed): (&Ray, &Placed),
    ) -> Option<f32> {
        let tested = match ray {
            None => block.tested_one(vectors, lane, &DoubleRay::ordinary(world)),
            Some(ray) => vectors.apart(TestedOne { block, lane, ray }),
        };
        let found = match tested {
            Verdict::Hit(found) => Some(found),
            Verdict::Miss => None,
            Verdict::Undecided => exactly(block, lane, world, placed),
        };
        found.map(|hit| {
            std::hint::black_box(hit.attributes);
            hit.t
        })
    }
}

/// The test of one triangle, as a function of its own.
struct TestedOne<'a> {
    block: &'a block::Triangles,
    lane: usize,
    ray: &'a DoubleRay,
}

impl Task for TestedOne<'_> {
    type Output = Verdict<Intersection>;

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) -> Verdict<Intersection> {
        self.block.tested_one(vectors, self.lane, self.ray)
    }
}

#[cold]
#[inline(never)]
fn exactly(block: &block::Triangles, lane: usize, ray: &Ray, placed: &Placed) -> Option<Intersection> {
    block.intersect(lane, &object_ray(ray, placed), Precision::Exact)
}

#[cold]
#[inline(never)]
fn object_ray(ray: &Ray, placed: &Placed) -> ObjectRay {
    let mut out = ObjectRay::IDLE;
    set(&mut out, ray, placed);
    out
}

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

impl ForBlocks for ShearedRay {
    #[inline(always)]
    fn prepared(ray: &Ray, object: &ObjectRay, around: &Bounds) -> Self {
        if object.is_in_world() && ray.is_ordinary() {
            return Self::ordinary(ray);
        }
        Self::of(&BlockRay::prepared(ray, object, around))
    }
}

impl ForBlocks for BoxRay {
    #[inline(always)]
    fn prepared(_: &Ray, object: &ObjectRay, around: &Bounds) -> Self {
        Self::new(object, around)
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
