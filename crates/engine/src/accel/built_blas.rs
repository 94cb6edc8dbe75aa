//! A built BLAS: its active primitives in tree order, and the BVH over them.

mod build;
mod collect;
pub(super) mod partial;

use bytemuck::NoUninit;

use crate::accel::flags::GeometryFlags;
use crate::accel::geometry::interpolate_triangle;
use crate::accel::geometry_data::bytes_of;
use crate::accel::node::NodeRef;
use crate::accel::primitive_numbers::{GeomPrim, PrimitiveNumbers};
use crate::accel::wide_bvh::WideBvh;
use crate::geometry::block::{self, CullRay, LANES, ShearedRay};
use crate::geometry::{Bounds, DoubleRay, Intersection, Intersection4, ObjectRay, Precision, triangle};
use crate::math::f32x4::FmaOps;
use crate::math::f64x4::F64x4Ops;
use crate::math::prefetch::prefetch;

/// The active primitives of a BLAS, and the BVH over them.
#[derive(Clone, Debug)]
pub(super) struct BuiltBlas {
    blocks: PrimitiveBlocks,
    /// The number of each primitive in tree order; [`PADDING`](super::wide_bvh::PADDING) fills
    /// leaves that are not full.
    order: Vec<u32>,
    /// What the numbers refer to.
    numbers: PrimitiveNumbers,
    /// Whether some primitives are in several leaves.
    has_split_primitives: bool,
    bvh: Option<WideBvh>,
    bounds: Bounds,
    common_flags: Option<GeometryFlags>,
}

/// Which rays are prepared for [`BuiltBlas::maybe_hit_mask`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Culling {
    /// No ray: a ray tests only one or two primitives, so that preparing it does not pay.
    Never,
    /// Rays that [`CullRay::world_space`] or [`CullRay::approximate`] can prepare.
    WorldSpace,
    /// Every ray.
    Always,
}

/// A ray for tests of all primitives of a leaf; each test reads one of the two forms.
pub(super) trait LeafRay {
    /// The ray in f64.
    fn double_ray<D: F64x4Ops>(&mut self, simd: D) -> DoubleRay<D>;

    /// The ray in object space, with bounds of its error.
    fn object_ray(&mut self) -> &ObjectRay;
}

/// A block of primitives that are tested all at once.
pub(super) trait WholeBlock: NoUninit {
    /// Whether the blocks of a node's leaves are prefetched with the node.
    const IS_PREFETCHED_WITH_NODE: bool;

    /// Tests all primitives by the f64 filter; hits behind `limit`, a rounded t, may be left out.
    fn intersect_all<D: F64x4Ops>(&self, simd: D, ray: &mut impl LeafRay, limit: f32) -> Intersection4;
}

impl WholeBlock for block::Triangle4 {
    const IS_PREFETCHED_WITH_NODE: bool = true;

    #[inline(always)]
    fn intersect_all<D: F64x4Ops>(&self, simd: D, ray: &mut impl LeafRay, limit: f32) -> Intersection4 {
        self.intersect4(simd, &ray.double_ray(simd), limit)
    }
}

impl WholeBlock for block::Sphere4 {
    const IS_PREFETCHED_WITH_NODE: bool = false;

    #[inline(always)]
    fn intersect_all<D: F64x4Ops>(&self, simd: D, ray: &mut impl LeafRay, limit: f32) -> Intersection4 {
        self.intersect4(simd, ray.object_ray(), limit)
    }
}

/// The primitives, all of one kind, in blocks of four.
#[derive(Clone, Debug)]
pub(super) enum PrimitiveBlocks {
    Triangles(Vec<block::Triangle4>),
    Aabbs(Vec<block::Aabb4>),
    Spheres(Vec<block::Sphere4>),
    /// The blocks, and the caps of each primitive.
    LinearSweptSpheres(Vec<block::LinearSweptSphere4>, Vec<[[bool; 2]; LANES]>),
    /// In tree order the vertices at time 0 and at time 1; `None` is padding.
    MovingTriangles(Vec<Option<MotionKeys>>),
}

/// The vertices of a triangle at time 0 and at time 1.
pub(super) type MotionKeys = [[[f32; 3]; 3]; 2];

impl BuiltBlas {
    /// The box around all active primitives, in object space.
    pub(super) fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The bytes that it takes.
    pub(super) fn memory_size(&self) -> usize {
        let blocks = match &self.blocks {
            PrimitiveBlocks::Triangles(blocks) => bytes_of(blocks),
            PrimitiveBlocks::Aabbs(blocks) => bytes_of(blocks),
            PrimitiveBlocks::Spheres(blocks) => bytes_of(blocks),
            PrimitiveBlocks::LinearSweptSpheres(blocks, caps) => bytes_of(blocks) + bytes_of(caps),
            PrimitiveBlocks::MovingTriangles(keys) => bytes_of(keys),
        };
        blocks
            + bytes_of(&self.order)
            + self.numbers.memory_size()
            + self.bvh.as_ref().map_or(0, WideBvh::memory_size)
    }

    /// The primitives in blocks of four.
    #[inline(always)]
    pub(super) fn blocks(&self) -> &PrimitiveBlocks {
        &self.blocks
    }

    /// The BVH; without one every ray tests all primitives.
    #[inline]
    pub(super) fn bvh(&self) -> Option<&WideBvh> {
        self.bvh.as_ref()
    }

    /// [`WideBvh::shrink_box`].
    #[cfg(any(test, feature = "test-support"))]
    pub(super) fn shrink_box(&mut self, slot: usize) {
        self.bvh.iter_mut().for_each(|bvh| bvh.shrink_box(slot));
    }

    /// All primitives as leaves, for a BLAS without a BVH.
    pub(super) fn leaves(&self) -> impl Iterator<Item = NodeRef> + use<> {
        let count = self.order.len();
        (0..count.div_ceil(LANES)).map(move |index| NodeRef::leaf(index, LANES.min(count - index * LANES)))
    }

    /// The identity of the primitive in a lane of a leaf.
    #[inline(always)]
    pub(super) fn geom_prim(&self, leaf: NodeRef, lane: usize) -> GeomPrim {
        self.geom_prim_at(self.ordered_index(leaf, lane))
    }

    /// Prefetches the triangles in the leaves of a node while the node itself is loaded, if a ray
    /// that visits the node usually reaches one of them.
    #[inline(always)]
    pub(super) fn prefetch_leaves(&self, bvh: &WideBvh, node: NodeRef) {
        if let PrimitiveBlocks::Triangles(blocks) = &self.blocks {
            bvh.leaves_to_prefetch(node).for_each(|leaf| prefetch(blocks, leaf));
        }
    }

    /// Prefetches the node or the block of primitives that a ray is about to visit.
    #[inline(always)]
    pub(super) fn prefetch(&self, child: NodeRef) {
        if !child.is_leaf() {
            return self.bvh.iter().for_each(|bvh| bvh.prefetch(child));
        }
        let at = child.index();
        match &self.blocks {
            PrimitiveBlocks::Triangles(blocks) => prefetch(blocks, at),
            PrimitiveBlocks::Aabbs(blocks) => prefetch(blocks, at),
            PrimitiveBlocks::Spheres(blocks) => prefetch(blocks, at),
            PrimitiveBlocks::LinearSweptSpheres(blocks, _) => prefetch(blocks, at),
            PrimitiveBlocks::MovingTriangles(_) => {}
        }
    }

    /// Prefetches the numbers of the primitives of a leaf.
    #[inline(always)]
    pub(super) fn prefetch_numbers(&self, leaf: NodeRef) {
        prefetch(self.order.as_chunks::<LANES>().0, leaf.index());
    }

    /// The index in tree order of a lane of a leaf.
    #[inline(always)]
    pub(super) fn ordered_index(&self, leaf: NodeRef, lane: usize) -> usize {
        leaf.index() * LANES + lane
    }

    /// The identity of the primitive at an index in tree order.
    #[inline(always)]
    pub(super) fn geom_prim_at(&self, ordered_index: usize) -> GeomPrim {
        self.numbers.geom_prim(self.order[ordered_index])
    }

    /// Whether a ray may reach one primitive in several leaves.
    #[inline]
    pub(super) fn has_split_primitives(&self) -> bool {
        self.has_split_primitives
    }

    /// Which rays cull primitives by blocks of four.
    #[inline(always)]
    pub(super) fn culling(&self) -> Culling {
        match self.blocks {
            PrimitiveBlocks::LinearSweptSpheres(..) => Culling::Always,
            PrimitiveBlocks::Triangles(_) | PrimitiveBlocks::Spheres(_) => Culling::WorldSpace,
            PrimitiveBlocks::Aabbs(_) | PrimitiveBlocks::MovingTriangles(_) => Culling::Never,
        }
    }

    /// Whether the primitives are triangles without motion.
    #[inline(always)]
    pub(super) fn has_triangles(&self) -> bool {
        matches!(self.blocks, PrimitiveBlocks::Triangles(_))
    }

    /// The flags of all geometries, if they agree and none has a micromap.
    #[inline]
    pub(super) fn common_flags(&self) -> Option<GeometryFlags> {
        self.common_flags
    }

    /// A mask of all primitives of a leaf.
    #[inline(always)]
    pub(super) fn full_mask(&self, leaf: NodeRef) -> u32 {
        (1 << leaf.count()) - 1
    }

    /// A mask of the primitives of a leaf that the line of the ray may hit. `TIGHT` culls more of
    /// the swept spheres that taper. Only for primitives that are [culled](BuiltBlas::culling) at
    /// all; triangles read `sheared`, the others `ray`.
    #[inline(always)]
    pub(super) fn maybe_hit_mask<F: FmaOps, const TIGHT: bool>(
        &self,
        simd: F,
        leaf: NodeRef,
        ray: &CullRay,
        sheared: &ShearedRay,
    ) -> u32 {
        let at = leaf.index();
        let maybe_hit = match &self.blocks {
            PrimitiveBlocks::Triangles(blocks) => blocks[at].maybe_hit_mask(simd, sheared),
            PrimitiveBlocks::Spheres(blocks) => blocks[at].maybe_entered_mask(simd, ray),
            PrimitiveBlocks::LinearSweptSpheres(blocks, _) if TIGHT => {
                blocks[at].maybe_hit_mask_tight(simd, ray)
            }
            PrimitiveBlocks::LinearSweptSpheres(blocks, _) => blocks[at].maybe_hit_mask(simd, ray),
            PrimitiveBlocks::Aabbs(_) | PrimitiveBlocks::MovingTriangles(_) => u32::MAX,
        };
        maybe_hit & self.full_mask(leaf)
    }

    /// Whether [`BuiltBlas::intersect_leaf`] tests whole leaves, which is faster than culling
    /// first.
    #[inline(always)]
    pub(super) fn tests_whole_leaves(&self, precision: Precision) -> bool {
        precision == Precision::Exact
            && matches!(self.blocks, PrimitiveBlocks::Triangles(_) | PrimitiveBlocks::Spheres(_))
    }

    /// Tests all primitives of a leaf at once by the f64 filter; hits behind `limit`, a rounded t,
    /// may be left out. Only if [`BuiltBlas::tests_whole_leaves`].
    #[inline(always)]
    pub(super) fn intersect_leaf<D: F64x4Ops>(
        &self,
        simd: D,
        leaf: NodeRef,
        ray: &mut impl LeafRay,
        limit: f32,
    ) -> Intersection4 {
        match &self.blocks {
            PrimitiveBlocks::Triangles(blocks) => blocks[leaf.index()].intersect_all(simd, ray, limit),
            PrimitiveBlocks::Spheres(blocks) => blocks[leaf.index()].intersect_all(simd, ray, limit),
            _ => Intersection4::MISSED,
        }
    }

    /// Intersects the primitive in a lane of a leaf at the time of the ray, within the ray's
    /// interval.
    #[inline(always)]
    pub(super) fn intersect(
        &self,
        leaf: NodeRef,
        lane: usize,
        ray: &ObjectRay,
        time: f32,
        precision: Precision,
    ) -> Option<Intersection> {
        let at = leaf.index();
        match &self.blocks {
            PrimitiveBlocks::Triangles(blocks) => blocks[at].intersect(lane, ray, precision),
            PrimitiveBlocks::Aabbs(blocks) => blocks[at].intersect(lane, ray, precision),
            PrimitiveBlocks::Spheres(blocks) => blocks[at].intersect(lane, ray, precision),
            PrimitiveBlocks::LinearSweptSpheres(blocks, caps) => {
                blocks[at].intersect(lane, &caps[at], ray, precision)
            }
            PrimitiveBlocks::MovingTriangles(all) => {
                intersect_moving_triangle(all[at * LANES + lane].as_ref()?, ray, time, precision)
            }
        }
    }
}

/// Intersects a moving triangle at the time of the ray. It is not inlined, so that triangles
/// without motion do not pay for it.
#[inline(never)]
fn intersect_moving_triangle(
    motion_keys: &MotionKeys,
    ray: &ObjectRay,
    time: f32,
    precision: Precision,
) -> Option<Intersection> {
    triangle::intersect(ray, interpolate_triangle(motion_keys, time), precision)
}
