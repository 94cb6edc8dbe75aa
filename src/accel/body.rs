//! What a BLAS is when rays reach it: active primitives in tree order, and the tree.

mod collect;

use crate::accel::blas::{GeometryFlags, between};
use crate::accel::node::NodeRef;
use crate::accel::wide_bvh::WideBvh;
use crate::geometry::block::{self, BlockRay, LANES, ShearedRay};
use crate::geometry::{Bounds, DoubleRay, FourTested, Intersection, ObjectRay, Precision, triangle};
use crate::math::ahead::fetch;
use crate::math::doubles::Doubles;
use crate::math::four::Fused;

/// The active primitives of a BLAS, and the tree over them.
#[derive(Debug)]
pub struct Body {
    shapes: Shapes,
    /// By place in tree order; [`Name::NONE`] where a leaf is not full.
    names: Vec<Name>,
    /// Whether some primitives stand in several leaves.
    has_pieces: bool,
    bvh: Option<WideBvh>,
    bounds: Bounds,
    common_flags: Option<GeometryFlags>,
}

/// Which primitive of a BLAS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name {
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
}

impl Name {
    /// No primitive.
    const NONE: Self = Self { geometry: u32::MAX, primitive: u32::MAX };
}

/// Whether a ray is made ready for [`Body::met`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drops {
    /// A ray comes to test one or two of them: that pays for nothing.
    Never,
    /// Where [`BlockRay::simple`] does.
    WhereSimple,
    /// For every ray.
    Always,
}

/// A ray for tests of all of a leaf's primitives; each reads one of the two.
pub trait LeafRay {
    /// In f64.
    fn double<D: Doubles>(&mut self, doubles: D) -> DoubleRay<D>;

    /// In object space.
    fn object(&mut self) -> &ObjectRay;
}

/// Primitives of one kind, four places a block.
#[derive(Debug)]
enum Shapes {
    Triangles(Vec<block::Triangles>),
    Aabbs(Vec<block::Aabbs>),
    Spheres(Vec<block::Spheres>),
    /// With the caps of each.
    LinearSweptSpheres(Vec<block::SweptEnds>, Vec<[[bool; 2]; LANES]>),
    /// By place: vertices at time 0 and at time 1.
    MovingTriangles(Vec<Option<Keys>>),
}

/// The vertices of a triangle at time 0 and at time 1.
type Keys = [[[f32; 3]; 3]; 2];

impl Body {
    /// The box around all active primitives.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The tree; without one, all primitives are tested.
    #[inline]
    pub fn bvh(&self) -> Option<&WideBvh> {
        self.bvh.as_ref()
    }

    /// All primitives, for a body without a tree.
    pub fn leaves(&self) -> impl Iterator<Item = NodeRef> + use<> {
        let count = self.names.len();
        (0..count.div_ceil(LANES)).map(move |index| NodeRef::leaf(index, LANES.min(count - index * LANES)))
    }

    /// Which primitive a lane of a leaf is.
    #[inline(always)]
    pub fn name(&self, leaf: NodeRef, lane: usize) -> Name {
        self.names[self.place(leaf, lane)]
    }

    /// Has the processor bring the triangles in a node's leaves into its caches, where a ray that comes to the node
    /// mostly reaches one: they come while the node does.
    #[inline(always)]
    pub fn fetch_leaves(&self, bvh: &WideBvh, node: NodeRef) {
        let leaves = bvh.leaves(node);
        if leaves.is_empty() {
            return;
        }
        if let Shapes::Triangles(blocks) = &self.shapes {
            blocks.get(leaves).unwrap_or_default().iter().for_each(block::Triangles::fetch);
        }
    }

    /// The same for what a ray will read of a part of the tree.
    #[inline(always)]
    pub fn fetch(&self, part: NodeRef) {
        if !part.is_leaf() {
            return self.bvh.iter().for_each(|bvh| bvh.node(part).fetch());
        }
        let at = part.index();
        match &self.shapes {
            Shapes::Triangles(blocks) => blocks[at].fetch(),
            Shapes::Aabbs(blocks) => blocks[at].fetch(),
            Shapes::Spheres(blocks) => blocks[at].fetch(),
            Shapes::LinearSweptSpheres(blocks, _) => blocks[at].fetch(),
            Shapes::MovingTriangles(_) => {}
        }
    }

    /// The same for the names of a leaf's primitives.
    #[inline(always)]
    pub fn fetch_names(&self, leaf: NodeRef) {
        fetch(&self.names[self.place(leaf, 0)..][..1]);
    }

    /// Where a lane of a leaf stands in tree order.
    #[inline(always)]
    pub fn place(&self, leaf: NodeRef, lane: usize) -> usize {
        leaf.index() * LANES + lane
    }

    /// Which primitive stands at a place in tree order.
    #[inline(always)]
    pub fn name_at(&self, place: usize) -> Name {
        self.names[place]
    }

    /// Whether a ray may come to one primitive several times.
    #[inline]
    pub fn has_pieces(&self) -> bool {
        self.has_pieces
    }

    /// Which rays drop primitives by blocks.
    #[inline(always)]
    pub fn drops(&self) -> Drops {
        match self.shapes {
            Shapes::LinearSweptSpheres(..) => Drops::Always,
            Shapes::Triangles(_) | Shapes::Spheres(_) => Drops::WhereSimple,
            Shapes::Aabbs(_) | Shapes::MovingTriangles(_) => Drops::Never,
        }
    }

    /// Whether they are triangles at rest.
    #[inline(always)]
    pub fn has_triangles(&self) -> bool {
        matches!(self.shapes, Shapes::Triangles(_))
    }

    /// The flags that all geometries have in common, where all have the same and no micromaps.
    #[inline]
    pub fn common_flags(&self) -> Option<GeometryFlags> {
        self.common_flags
    }

    /// A bit for each of a leaf's primitives.
    #[inline(always)]
    pub fn every(&self, leaf: NodeRef) -> u32 {
        (1 << leaf.count()) - 1
    }

    /// A bit for each of a leaf's primitives that the ray's line does not surely miss; `CLOSELY`: fewer of those that
    /// taper. Only for bodies that [drop](Body::drops) some; triangles read the second ray.
    #[inline(always)]
    pub fn met<F: Fused, const CLOSELY: bool>(
        &self,
        fused: F,
        leaf: NodeRef,
        (ray, sheared): (&BlockRay, &ShearedRay),
    ) -> u32 {
        let at = leaf.index();
        let met = match &self.shapes {
            Shapes::Triangles(blocks) => blocks[at].met(fused, sheared),
            Shapes::Spheres(blocks) => blocks[at].entered(fused, ray),
            Shapes::LinearSweptSpheres(blocks, _) if CLOSELY => blocks[at].met_closely(fused, ray),
            Shapes::LinearSweptSpheres(blocks, _) => blocks[at].met(fused, ray),
            Shapes::Aabbs(_) | Shapes::MovingTriangles(_) => u32::MAX,
        };
        met & self.every(leaf)
    }

    /// Whether [`Body::tested`] decides about a whole leaf: that is better than to drop some.
    #[inline(always)]
    pub fn tests_leaves(&self, precision: Precision) -> bool {
        precision == Precision::Exact && matches!(self.shapes, Shapes::Triangles(_) | Shapes::Spheres(_))
    }

    /// The exact test of all of a leaf's primitives, as far as f64 carries; what lies behind `limit`, a
    /// rounded t, may be left out. Only for bodies that [test leaves](Body::tests_leaves).
    #[inline(always)]
    pub fn tested<D: Doubles>(
        &self,
        doubles: D,
        leaf: NodeRef,
        ray: &mut impl LeafRay,
        limit: f32,
    ) -> FourTested {
        match &self.shapes {
            Shapes::Triangles(blocks) => blocks[leaf.index()].tested(doubles, &ray.double(doubles), limit),
            Shapes::Spheres(blocks) => blocks[leaf.index()].tested(doubles, ray.object(), limit),
            _ => FourTested::MISSED,
        }
    }

    /// Where a ray of a time meets the primitive in a leaf's lane, within the ray's whole interval.
    #[inline(always)]
    pub fn intersect(
        &self,
        (leaf, lane): (NodeRef, usize),
        ray: &ObjectRay,
        time: f32,
        precision: Precision,
    ) -> Option<Intersection> {
        let at = leaf.index();
        match &self.shapes {
            Shapes::Triangles(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::Aabbs(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::Spheres(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::LinearSweptSpheres(blocks, caps) => blocks[at].intersect(lane, &caps[at], ray, precision),
            Shapes::MovingTriangles(all) => moving(all[at * LANES + lane].as_ref()?, ray, time, precision),
        }
    }
}

/// Where a ray of a time meets a triangle that moves; apart, so that those at rest pay nothing.
#[inline(never)]
fn moving(keys: &Keys, ray: &ObjectRay, time: f32, precision: Precision) -> Option<Intersection> {
    triangle::intersect(ray, between(keys, time), precision)
}
