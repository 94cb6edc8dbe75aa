//! The contenders: this crate in its three precisions, and formulas as they are published, in
//! plain f32. Every contender has a test of a block of four and a test of one lane that passed it.

use anyhit_engine::geometry::block::{self, BoxRay, CullRay, ShearedRay};
use anyhit_engine::geometry::{
    Bounds, DoubleRay, Intersection, ObjectRay, Precision, Ray, Transform, Verdict,
};
use anyhit_engine::math::lane_ops::LaneOps;

use crate::shape::Shape;

/// An instance: for this crate its exact transform, for the others the inverse in f32.
pub struct PlacedInstance {
    pub transform: Option<Transform>,
    pub inverse: [[f32; 4]; 3],
}

impl PlacedInstance {
    /// The ray in object space.
    pub fn object(&self, ray: &Ray) -> ObjectRay {
        let mut out = ObjectRay::EMPTY;
        self.to_object_space(ray, &mut out);
        out
    }

    /// Transforms a ray to object space.
    #[inline(always)]
    fn to_object_space(&self, ray: &Ray, out: &mut ObjectRay) {
        let is_ray = match &self.transform {
            Some(transform) => out.set_in_instance(ray, transform),
            None => out.set_in_world(ray),
        };
        assert!(is_ray, "a finite ray");
    }
}

/// An intersection method.
pub trait Contender {
    /// Four primitives.
    type Block;
    /// A ray prepared for an instance.
    type PreparedRay: Copy;
    /// Placeholder value.
    const EMPTY: Self::PreparedRay;

    fn block(shapes: &[Shape]) -> Self::Block;
    /// Prepares a ray for an instance.
    fn prepare(out: &mut Self::PreparedRay, ray: &Ray, placed: &PlacedInstance, around: &Bounds);
    /// A bit for each lane that may be hit.
    fn maybe_hit_mask<V: LaneOps>(simd: V, block: &Self::Block, prepared: &Self::PreparedRay) -> u32;
    /// The t of a lane; `whole` holds the ray and the instance that it was prepared for.
    fn hit<V: LaneOps>(
        simd: V,
        lane: (&Self::Block, usize),
        prepared: &mut Self::PreparedRay,
        whole: (&Ray, &PlacedInstance),
    ) -> Option<f32>;
}

/// This crate's tests of one kind of block.
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
    ($block:ty, $cull_ray:ident, $simd:ident, $prepared:ident => $maybe_hit:expr, $shape:pat => $block_name:ident, $lane:ident, $set:expr $(, $caps:expr)?) => {
        impl<const P: u8> Contender for Ours<$block, P> {
            type Block = $block;
            type PreparedRay = LazyObjectRay<$cull_ray>;
            const EMPTY: Self::PreparedRay =
                LazyObjectRay { blocks: $cull_ray::EMPTY, object: ObjectRay::EMPTY, has_object: false };

            fn block(shapes: &[Shape]) -> Self::Block {
                let mut $block_name = <$block>::EMPTY;
                for ($lane, shape) in shapes.iter().enumerate() {
                    let $shape = *shape else { panic!("a BLAS of two kinds") };
                    $set;
                }
                $block_name
            }

            #[inline(always)]
            fn prepare(out: &mut Self::PreparedRay, ray: &Ray, placed: &PlacedInstance, around: &Bounds) {
                out.set(ray, placed, around);
            }

            #[inline(always)]
            fn maybe_hit_mask<V: LaneOps>($simd: V, $block_name: &Self::Block, prepared: &Self::PreparedRay) -> u32 {
                let $prepared = &prepared.blocks;
                $maybe_hit
            }

            #[inline(always)]
            fn hit<V: LaneOps>(
                _: V,
                (block, lane): (&Self::Block, usize),
                prepared: &mut Self::PreparedRay,
                whole: (&Ray, &PlacedInstance),
            ) -> Option<f32> {
                block.intersect(lane, $($caps,)? prepared.object(whole), precision(P)).map(|hit| hit.t)
            }
        }
    };
}

ours!(block::Sphere4, CullRay, simd, ray => block.maybe_entered_mask(simd, ray),
    Shape::Sphere(center, radius) => block, lane, block.set(lane, center, radius));
ours!(block::LinearSweptSphere4, CullRay, simd, ray => block.maybe_hit_mask_tight(simd, ray),
    Shape::Swept(positions, radii) => block, lane, block.set(lane, positions, radii), &[[true; 2]; block::LANES]);
ours!(block::Triangle4, ShearedRay, simd, ray => block.maybe_hit_mask(simd, ray),
    Shape::Triangle(vertices) => block, lane, block.set(lane, vertices));
ours!(block::Aabb4, BoxRay, _vectors, ray => block.maybe_hit_mask(ray),
    Shape::Aabb([min, max]) => block, lane, block.set(lane, min, max));

/// This crate's exact test of triangles, with the f64 filter on the processor's SIMD registers.
/// Where object space is world space, no ray in object space is computed.
pub struct ExactTriangles;

type Triangles = Ours<block::Triangle4, EXACT>;

impl Contender for ExactTriangles {
    type Block = block::Triangle4;
    type PreparedRay = LazyObjectRay<ShearedRay>;
    const EMPTY: Self::PreparedRay = Triangles::EMPTY;

    fn block(shapes: &[Shape]) -> Self::Block {
        Triangles::block(shapes)
    }

    #[inline(always)]
    fn prepare(out: &mut Self::PreparedRay, ray: &Ray, placed: &PlacedInstance, around: &Bounds) {
        Triangles::prepare(out, ray, placed, around);
    }

    #[inline(always)]
    fn maybe_hit_mask<V: LaneOps>(simd: V, block: &Self::Block, prepared: &Self::PreparedRay) -> u32 {
        Triangles::maybe_hit_mask(simd, block, prepared)
    }

    #[inline(always)]
    fn hit<V: LaneOps>(
        simd: V,
        (block, lane): (&Self::Block, usize),
        prepared: &mut Self::PreparedRay,
        (ray, placed): (&Ray, &PlacedInstance),
    ) -> Option<f32> {
        // There are two calls, as one call on either ray would reload it from memory where both
        // branches join.
        let tested = if placed.transform.is_none() {
            block.intersect_simd(simd, lane, &DoubleRay::in_world(simd, ray))
        } else {
            block.intersect_simd(simd, lane, &DoubleRay::of(simd, prepared.object((ray, placed))))
        };
        let found = match tested {
            Verdict::Hit(found) => Some(found),
            Verdict::Miss => None,
            Verdict::Undecided => undecided(block, lane, ray, placed),
        };
        found.map(|hit| {
            std::hint::black_box(hit.attributes);
            hit.t
        })
    }
}

#[cold]
#[inline(never)]
fn undecided(
    block: &block::Triangle4,
    lane: usize,
    ray: &Ray,
    placed: &PlacedInstance,
) -> Option<Intersection> {
    block.intersect(lane, &placed.object(ray), Precision::Exact)
}

/// A ray for this crate: prepared for blocks, and on first use for exact tests.
#[derive(Clone, Copy)]
pub struct LazyObjectRay<R> {
    blocks: R,
    object: ObjectRay,
    has_object: bool,
}

impl<R: BlockCullRay> LazyObjectRay<R> {
    #[inline(always)]
    fn set(&mut self, ray: &Ray, placed: &PlacedInstance, around: &Bounds) {
        let cull_ray = R::without_object_ray(ray, placed, around);
        self.has_object = cull_ray.is_none();
        if let Some(blocks) = cull_ray {
            self.blocks = blocks;
        } else {
            placed.to_object_space(ray, &mut self.object);
            self.blocks = R::new(&self.object, around);
        }
    }
}

impl<R> LazyObjectRay<R> {
    #[inline(always)]
    fn object(&mut self, (ray, placed): (&Ray, &PlacedInstance)) -> &ObjectRay {
        if !self.has_object {
            self.has_object = true;
            placed.to_object_space(ray, &mut self.object);
        }
        &self.object
    }
}

/// A ray prepared for blocks.
pub trait BlockCullRay: Sized {
    /// Prepares the ray without a ray in object space, where that is possible.
    fn without_object_ray(ray: &Ray, placed: &PlacedInstance, around: &Bounds) -> Option<Self>;
    fn new(object: &ObjectRay, around: &Bounds) -> Self;
}

impl BlockCullRay for CullRay {
    #[inline(always)]
    fn without_object_ray(ray: &Ray, placed: &PlacedInstance, around: &Bounds) -> Option<Self> {
        match &placed.transform {
            None => Self::world_space(ray, around),
            Some(transform) => Self::approximate(&transform.approximate(ray)?, around),
        }
    }

    #[inline(always)]
    fn new(object: &ObjectRay, around: &Bounds) -> Self {
        Self::new(object, around)
    }
}

impl BlockCullRay for ShearedRay {
    #[inline(always)]
    fn without_object_ray(ray: &Ray, placed: &PlacedInstance, around: &Bounds) -> Option<Self> {
        match &placed.transform {
            None => Self::world_space(ray),
            Some(_) => CullRay::without_object_ray(ray, placed, around).as_ref().map(Self::of),
        }
    }

    #[inline(always)]
    fn new(object: &ObjectRay, around: &Bounds) -> Self {
        Self::of(&CullRay::new(object, around))
    }
}

impl BlockCullRay for BoxRay {
    #[inline(always)]
    fn without_object_ray(_: &Ray, _: &PlacedInstance, _: &Bounds) -> Option<Self> {
        None
    }

    #[inline(always)]
    fn new(object: &ObjectRay, around: &Bounds) -> Self {
        Self::new(object, around)
    }
}
