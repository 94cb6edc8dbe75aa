//! The contenders: this crate in its three precisions, and formulas as they are published, in
//! plain f32. Every contender has a test of a block of four and a test of one lane that passed it.

use anyhit::geometry::block::{self, BoxRay, CullRay, ShearedRay};
use anyhit::geometry::{Bounds, DoubleRay, Intersection, ObjectRay, Precision, Ray, Transform, Verdict};
use anyhit::math::lane_ops::LaneOps;

use crate::shape::Shape;

/// An instance: for this crate its exact transform, for the others the inverse in f32.
pub struct Placed {
    pub transform: Option<Transform>,
    pub inverse: [[f32; 4]; 3],
}

impl Placed {
    /// The ray in object space.
    pub fn object(&self, ray: &Ray) -> ObjectRay {
        let mut out = ObjectRay::EMPTY;
        self.bring(ray, &mut out);
        out
    }

    /// Brings a ray into object space.
    #[inline(always)]
    fn bring(&self, ray: &Ray, out: &mut ObjectRay) {
        let is_ray = match &self.transform {
            Some(transform) => out.set_in_instance(ray, transform),
            None => out.set_in_world(ray),
        };
        assert!(is_ray, "a finite ray");
    }
}

/// One way to intersect.
pub trait Contender {
    /// Four primitives.
    type Block;
    /// A ray made ready for an instance.
    type Ready: Copy;
    /// Placeholder value.
    const EMPTY: Self::Ready;

    fn block(shapes: &[Shape]) -> Self::Block;
    /// Makes a ray ready.
    fn ready(out: &mut Self::Ready, ray: &Ray, placed: &Placed, around: &Bounds);
    /// A bit for each lane that may be hit.
    fn maybe_hit_mask<V: LaneOps>(simd: V, block: &Self::Block, ready: &Self::Ready) -> u32;
    /// The t of a lane; ray and instance are what it was made ready of.
    fn hit<V: LaneOps>(
        simd: V,
        lane: (&Self::Block, usize),
        ready: &mut Self::Ready,
        whole: (&Ray, &Placed),
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
    ($block:ty, $cull_ray:ident, $simd:ident, $ready:ident => $met:expr, $shape:pat => $block_name:ident, $lane:ident, $set:expr $(, $caps:expr)?) => {
        impl<const P: u8> Contender for Ours<$block, P> {
            type Block = $block;
            type Ready = Ready<$cull_ray>;
            const EMPTY: Self::Ready =
                Ready { blocks: $cull_ray::EMPTY, object: ObjectRay::EMPTY, has_object: false };

            fn block(shapes: &[Shape]) -> Self::Block {
                let mut $block_name = <$block>::EMPTY;
                for ($lane, shape) in shapes.iter().enumerate() {
                    let $shape = *shape else { panic!("a BLAS of two kinds") };
                    $set;
                }
                $block_name
            }

            #[inline(always)]
            fn ready(out: &mut Self::Ready, ray: &Ray, placed: &Placed, around: &Bounds) {
                out.set(ray, placed, around);
            }

            #[inline(always)]
            fn maybe_hit_mask<V: LaneOps>($simd: V, $block_name: &Self::Block, ready: &Self::Ready) -> u32 {
                let $ready = &ready.blocks;
                $met
            }

            #[inline(always)]
            fn hit<V: LaneOps>(
                _: V,
                (block, lane): (&Self::Block, usize),
                ready: &mut Self::Ready,
                whole: (&Ray, &Placed),
            ) -> Option<f32> {
                block.intersect(lane, $($caps,)? ready.object(whole), precision(P)).map(|hit| hit.t)
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

/// This crate with triangles and exactly, the f64 step on the processor's vectors: without a ray in
/// object space where that is the world's.
pub struct ExactTriangles;

type Triangles = Ours<block::Triangle4, EXACT>;

impl Contender for ExactTriangles {
    type Block = block::Triangle4;
    type Ready = Ready<ShearedRay>;
    const EMPTY: Self::Ready = Triangles::EMPTY;

    fn block(shapes: &[Shape]) -> Self::Block {
        Triangles::block(shapes)
    }

    #[inline(always)]
    fn ready(out: &mut Self::Ready, ray: &Ray, placed: &Placed, around: &Bounds) {
        Triangles::ready(out, ray, placed, around);
    }

    #[inline(always)]
    fn maybe_hit_mask<V: LaneOps>(simd: V, block: &Self::Block, ready: &Self::Ready) -> u32 {
        Triangles::maybe_hit_mask(simd, block, ready)
    }

    #[inline(always)]
    fn hit<V: LaneOps>(
        simd: V,
        (block, lane): (&Self::Block, usize),
        ready: &mut Self::Ready,
        (ray, placed): (&Ray, &Placed),
    ) -> Option<f32> {
        // Not one test of either ray, which would be taken apart where both ways meet.
        let tested = if placed.transform.is_none() {
            block.intersect_simd(simd, lane, &DoubleRay::in_world(simd, ray))
        } else {
            block.intersect_simd(simd, lane, &DoubleRay::of(simd, ready.object((ray, placed))))
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
fn undecided(block: &block::Triangle4, lane: usize, ray: &Ray, placed: &Placed) -> Option<Intersection> {
    block.intersect(lane, &placed.object(ray), Precision::Exact)
}

/// A ray for this crate: for blocks, and for exact tests from the first of them on.
#[derive(Clone, Copy)]
pub struct Ready<R> {
    blocks: R,
    object: ObjectRay,
    has_object: bool,
}

impl<R: ForBlocks> Ready<R> {
    #[inline(always)]
    fn set(&mut self, ray: &Ray, placed: &Placed, around: &Bounds) {
        let early = R::early(ray, placed, around);
        self.has_object = early.is_none();
        if let Some(blocks) = early {
            self.blocks = blocks;
        } else {
            placed.bring(ray, &mut self.object);
            self.blocks = R::new(&self.object, around);
        }
    }
}

impl<R> Ready<R> {
    #[inline(always)]
    fn object(&mut self, (ray, placed): (&Ray, &Placed)) -> &ObjectRay {
        if !self.has_object {
            self.has_object = true;
            placed.bring(ray, &mut self.object);
        }
        &self.object
    }
}

/// A ray made ready for blocks.
pub trait ForBlocks: Sized {
    /// Without a ray in object space, where that is possible.
    fn early(ray: &Ray, placed: &Placed, around: &Bounds) -> Option<Self>;
    fn new(object: &ObjectRay, around: &Bounds) -> Self;
}

impl ForBlocks for CullRay {
    #[inline(always)]
    fn early(ray: &Ray, placed: &Placed, around: &Bounds) -> Option<Self> {
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

impl ForBlocks for ShearedRay {
    #[inline(always)]
    fn early(ray: &Ray, placed: &Placed, around: &Bounds) -> Option<Self> {
        match &placed.transform {
            None => Self::world_space(ray),
            Some(_) => CullRay::early(ray, placed, around).as_ref().map(Self::of),
        }
    }

    #[inline(always)]
    fn new(object: &ObjectRay, around: &Bounds) -> Self {
        Self::of(&CullRay::new(object, around))
    }
}

impl ForBlocks for BoxRay {
    #[inline(always)]
    fn early(_: &Ray, _: &Placed, _: &Bounds) -> Option<Self> {
        None
    }

    #[inline(always)]
    fn new(object: &ObjectRay, around: &Bounds) -> Self {
        Self::new(object, around)
    }
}
