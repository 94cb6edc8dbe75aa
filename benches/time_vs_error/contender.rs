//! What is compared: this crate in its three precisions, and formulas as they are published, in
//! plain f32. Every contender has a test of a block of four and a test of one lane that passed it.

use anyhit::geometry::block::{self, BlockRay, BoxRay, ShearedRay};
use anyhit::geometry::{Bounds, DoubleRay, Intersection, ObjectRay, Precision, Ray, Transform, Verdict};
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
    /// Memory for one.
    const IDLE: Self::Ray;

    fn block(shapes: &[Shape]) -> Self::Block;
    /// Brings a ray into object space.
    fn ready(out: &mut Self::Ray, ray: &Ray, placed: &Placed, around: &Bounds);
    /// A bit for each lane that may be hit.
    fn met<V: Vectors>(vectors: V, block: &Self::Block, ray: &Self::Ray) -> u32;
    /// The t of a lane.
    fn hit<V: Vectors>(vectors: V, block: &Self::Block, lane: usize, ray: &Self::Ray) -> Option<f32>;
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
            fn hit<V: Vectors>(_: V, block: &Self::Block, lane: usize, ray: &Self::Ray) -> Option<f32> {
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
    type Ray = (ShearedRay, Whole);
    const IDLE: Self::Ray = (ShearedRay::IDLE, Whole::InObject(ObjectRay::IDLE));

    fn block(shapes: &[Shape]) -> Self::Block {
        Ours::<block::Triangles, EXACT>::block(shapes)
    }

    #[inline(always)]
    fn ready(out: &mut Self::Ray, ray: &Ray, placed: &Placed, around: &Bounds) {
        let simple = if placed.transform.is_none() { ShearedRay::simple(ray) } else { None };
        if let Some(simple) = simple {
            out.0 = simple;
            out.1 = Whole::InWorld(*ray);
        } else {
            let mut object = ObjectRay::IDLE;
            set(&mut object, ray, placed);
            out.0 = ShearedRay::prepared(ray, &object, around);
            out.1 = Whole::InObject(object);
        }
    }

    #[inline(always)]
    fn met<V: Vectors>(vectors: V, block: &Self::Block, (ray, _): &Self::Ray) -> u32 {
        block.met(vectors, ray)
    }

    #[inline(always)]
    fn hit<V: Vectors>(vectors: V, block: &Self::Block, lane: usize, (_, ray): &Self::Ray) -> Option<f32> {
        let tested = match ray {
            Whole::InWorld(ray) => block.tested_one(vectors, lane, &DoubleRay::in_world(vectors, ray)),
            Whole::InObject(ray) => block.tested_one(vectors, lane, &DoubleRay::of(vectors, ray)),
        };
        let found = match tested {
            Verdict::Hit(found) => Some(found),
            Verdict::Miss => None,
            Verdict::Undecided => ray.intersect(block, lane),
        };
        found.map(|hit| {
            std::hint::black_box(hit.attributes);
            hit.t
        })
    }
}

/// What exact tests start from.
#[allow(clippy::large_enum_variant, reason = "there is one, written in place")]
#[derive(Clone, Copy)]
pub enum Whole {
    /// In world space, where its triangles are.
    InWorld(Ray),
    InObject(ObjectRay),
}

impl Whole {
    #[cold]
    #[inline(never)]
    fn intersect(&self, block: &block::Triangles, lane: usize) -> Option<Intersection> {
        match self {
            Self::InWorld(ray) => block.intersect(lane, &ObjectRay::in_world(ray)?, Precision::Exact),
            Self::InObject(ray) => block.intersect(lane, ray, Precision::Exact),
        }
    }
}

/// A ray made ready for blocks.
pub trait ForBlocks {
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
        let simple = if object.is_in_world() { Self::simple(ray) } else { None };
        simple.unwrap_or_else(|| Self::of(&BlockRay::prepared(ray, object, around)))
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
