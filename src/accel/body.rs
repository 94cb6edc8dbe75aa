//! What a BLAS is when rays reach it: active primitives in tree order, and the tree.

use crate::accel::blas::{Geometry, GeometryFlags, between};
use crate::accel::node::Child;
use crate::accel::primitive::Primitive;
use crate::accel::tree::Tree;
use crate::geometry::block::{self, BlockRay, LANES};
use crate::geometry::{
    Bounds, Intersection, ObjectRay, Precision, aabb, linear_swept_sphere, sphere, triangle,
};

/// Up to this many primitives are tested one by one, without boxes or tree: a node test and a
/// primitive's test cost about the same.
const LINEAR: usize = 4;

/// The most primitives of a leaf: a block.
const LEAF: u32 = LANES as u32;

/// The active primitives of a BLAS, and the tree over them.
#[derive(Debug)]
pub struct Body {
    shapes: Shapes,
    /// By place in tree order; a leaf that is not full leaves places empty.
    names: Vec<Option<Name>>,
    tree: Option<Tree>,
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

/// Primitives of one kind, four places a block.
#[derive(Debug)]
enum Shapes {
    Triangles(Vec<block::Triangles>),
    Aabbs(Vec<block::Aabbs>),
    Spheres(Vec<block::Spheres>),
    LinearSweptSpheres(Vec<block::LinearSweptSpheres>),
    /// By place: vertices at time 0 and at time 1.
    MovingTriangles(Vec<Option<Keys>>),
}

/// The vertices of a triangle at time 0 and at time 1.
type Keys = [[[f32; 3]; 3]; 2];

impl Body {
    /// Collects the active primitives and builds the tree where it pays.
    pub fn build(geometries: &[Geometry]) -> Self {
        if geometries.iter().any(|geometry| geometry.vertices_t1.is_some()) {
            return Self::build_moving(geometries);
        }
        let mut primitives = Vec::new();
        let mut names = Vec::new();
        let mut boxes = Vec::new();
        for (geometry, Geometry { data, .. }) in geometries.iter().enumerate() {
            for primitive in 0..data.primitive_count() as u32 {
                let numbers = data.primitive(primitive);
                if let Some(bounds) = bounds(&numbers) {
                    primitives.push(numbers);
                    names.push(Name { geometry: geometry as u32, primitive });
                    boxes.push(bounds);
                }
            }
        }
        Self::around(geometries, &boxes, &names, |order| {
            let at = |&number: &u32| primitives.get(number as usize).copied();
            Shapes::of(&order.iter().map(at).collect::<Vec<_>>())
        })
    }

    /// The same for triangles of which some move. The interpolated coordinates of a vertex lie
    /// between those of its keys, so a box around both keys holds them all.
    #[cold]
    fn build_moving(geometries: &[Geometry]) -> Self {
        let mut all = Vec::new();
        let mut names = Vec::new();
        let mut boxes = Vec::new();
        for (number, geometry) in geometries.iter().enumerate() {
            for primitive in 0..geometry.data.primitive_count() as u32 {
                let keys = geometry.keys(primitive).or_else(|| match geometry.data.primitive(primitive) {
                    Primitive::Triangle(vertices) => Some([vertices; 2]),
                    _ => None,
                });
                let bounds = keys.and_then(|[first, second]| {
                    Some(triangle::bounds(first)?.union(&triangle::bounds(second)?))
                });
                if let (Some(keys), Some(bounds)) = (keys, bounds) {
                    all.push(keys);
                    names.push(Name { geometry: number as u32, primitive });
                    boxes.push(bounds);
                }
            }
        }
        Self::around(geometries, &boxes, &names, |order| {
            let at = |&number: &u32| all.get(number as usize).copied();
            Shapes::MovingTriangles(order.iter().map(at).collect())
        })
    }

    /// The tree over boxes, where it pays, and the shapes in its order.
    fn around(
        geometries: &[Geometry],
        boxes: &[Bounds],
        names: &[Name],
        shapes: impl FnOnce(&[u32]) -> Shapes,
    ) -> Self {
        let around = boxes.iter().fold(Bounds::EMPTY, |all, one| all.union(one));
        let (tree, order) = if boxes.len() <= LINEAR {
            (None, (0..boxes.len() as u32).collect())
        } else {
            let (tree, order) = Tree::build(boxes, LEAF).expect("bug in anyhit: a tree of no boxes");
            (Some(tree), order)
        };
        let names = order.iter().map(|&number| names.get(number as usize).copied()).collect();
        let common_flags = geometries.first().map(|first| first.flags).filter(|&flags| {
            geometries.iter().all(|one| one.flags == flags && one.opacity_micromap.is_none())
        });
        Self { shapes: shapes(&order), names, tree, bounds: around, common_flags }
    }

    /// The box around all active primitives, without building anything.
    pub fn bounds_of(geometries: &[Geometry]) -> Bounds {
        let primitives = geometries.iter().flat_map(|Geometry { data, .. }| {
            (0..data.primitive_count() as u32).map(|at| data.primitive(at))
        });
        let boxes = primitives.filter_map(|primitive| bounds(&primitive));
        boxes.fold(Bounds::EMPTY, |all, one| all.union(&one))
    }

    /// The box around all active primitives.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The tree; without one, all primitives are tested.
    #[inline]
    pub fn tree(&self) -> Option<&Tree> {
        self.tree.as_ref()
    }

    /// All places, for a body without a tree.
    #[inline]
    pub fn all(&self) -> Child {
        Child { first: 0, count: self.names.len() as u32 }
    }

    /// Which primitive stands at a place in tree order.
    #[inline(always)]
    pub fn name(&self, place: usize) -> Name {
        self.names[place].expect("bug in anyhit: a leaf holds an empty place")
    }

    /// A ray for [`Body::met`], where that pays.
    #[inline]
    pub fn block_ray(&self, ray: &ObjectRay) -> Option<BlockRay> {
        match self.shapes {
            Shapes::LinearSweptSpheres(_) => Some(BlockRay::new(ray, &self.bounds)),
            // A ray comes to test two triangles, spheres or boxes: that pays for little.
            Shapes::Triangles(_) => BlockRay::simple(ray, &self.bounds),
            Shapes::Spheres(_) | Shapes::Aabbs(_) | Shapes::MovingTriangles(_) => None,
        }
    }

    /// The flags that all geometries have in common, where all have the same and no micromaps.
    #[inline]
    pub fn common_flags(&self) -> Option<GeometryFlags> {
        self.common_flags
    }

    /// A bit for each of a leaf's primitives.
    #[inline(always)]
    pub fn every(&self, leaf: Child) -> u32 {
        (1 << leaf.count) - 1
    }

    /// A bit for each of a leaf's primitives that the ray's line does not surely miss.
    #[inline(always)]
    pub fn met(&self, leaf: Child, ray: Option<&BlockRay>) -> u32 {
        let Some(ray) = ray else { return self.every(leaf) };
        let at = leaf.first as usize / LANES;
        let met = match &self.shapes {
            Shapes::Triangles(blocks) => blocks[at].met(ray),
            Shapes::Aabbs(blocks) => blocks[at].met(ray),
            Shapes::Spheres(blocks) => blocks[at].met(ray),
            Shapes::LinearSweptSpheres(blocks) => blocks[at].met(ray),
            Shapes::MovingTriangles(_) => u32::MAX,
        };
        met & self.every(leaf)
    }

    /// Where a ray of a time meets the primitive at a place in tree order, within the ray's whole
    /// interval.
    #[inline(always)]
    pub fn intersect(
        &self,
        place: usize,
        ray: &ObjectRay,
        time: f32,
        precision: Precision,
    ) -> Option<Intersection> {
        let (at, lane) = (place / LANES, place % LANES);
        match &self.shapes {
            Shapes::Triangles(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::Aabbs(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::Spheres(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::LinearSweptSpheres(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::MovingTriangles(all) => moving(all[place].as_ref()?, ray, time, precision),
        }
    }
}

/// Where a ray of a time meets a triangle that moves; apart, so that those at rest pay nothing.
#[inline(never)]
fn moving(keys: &Keys, ray: &ObjectRay, time: f32, precision: Precision) -> Option<Intersection> {
    triangle::intersect(ray, between(keys, time), precision)
}

impl Shapes {
    /// Takes primitives of one kind by place; some places are empty.
    fn of(places: &[Option<Primitive>]) -> Self {
        let count = places.len().div_ceil(LANES);
        let mut shapes = match places.iter().flatten().next() {
            Some(Primitive::Aabb(_)) => Self::Aabbs(vec![block::Aabbs::EMPTY; count]),
            Some(Primitive::Sphere { .. }) => Self::Spheres(vec![block::Spheres::EMPTY; count]),
            Some(Primitive::LinearSweptSphere { .. }) => {
                Self::LinearSweptSpheres(vec![block::LinearSweptSpheres::EMPTY; count])
            }
            Some(Primitive::Triangle(_)) | None => Self::Triangles(vec![block::Triangles::EMPTY; count]),
        };
        for (place, primitive) in places.iter().enumerate() {
            let (at, lane) = (place / LANES, place % LANES);
            match (&mut shapes, *primitive) {
                (_, None) => {}
                (Self::Triangles(blocks), Some(Primitive::Triangle(vertices))) => {
                    blocks[at].set(lane, vertices);
                }
                (Self::Aabbs(blocks), Some(Primitive::Aabb(minimum_maximum))) => {
                    let (min, max) = corners(minimum_maximum);
                    blocks[at].set(lane, min, max);
                }
                (Self::Spheres(blocks), Some(Primitive::Sphere { position, radius })) => {
                    blocks[at].set(lane, position, radius);
                }
                (
                    Self::LinearSweptSpheres(blocks),
                    Some(Primitive::LinearSweptSphere { positions, radii, caps }),
                ) => blocks[at].set(lane, positions, radii, caps),
                _ => unreachable!("bug in anyhit: a BLAS of two kinds of primitive"),
            }
        }
        shapes
    }
}

/// The box around a primitive; `None` where it is inactive or can never be hit.
fn bounds(primitive: &Primitive) -> Option<Bounds> {
    match *primitive {
        Primitive::Triangle(vertices) => triangle::bounds(vertices),
        Primitive::Aabb(minimum_maximum) => {
            let (min, max) = corners(minimum_maximum);
            aabb::bounds(min, max)
        }
        Primitive::Sphere { position, radius } => sphere::bounds(position, radius),
        Primitive::LinearSweptSphere { positions, radii, .. } => {
            linear_swept_sphere::bounds(positions, radii)
        }
    }
}

#[inline]
fn corners([x0, y0, z0, x1, y1, z1]: [f32; 6]) -> ([f32; 3], [f32; 3]) {
    ([x0, y0, z0], [x1, y1, z1])
}
