//! What a BLAS is when rays reach it: active primitives in tree order, and the tree.

use crate::accel::blas::{Geometry, GeometryFlags, between};
use crate::accel::geometry_data::GeometryKind;
use crate::accel::node::Child;
use crate::accel::primitive::Primitive;
use crate::accel::split::LeafCost;
use crate::accel::tree::Tree;
use crate::geometry::block::{self, BlockRay, LANES};
use crate::geometry::{
    Bounds, Intersection, ObjectRay, Precision, aabb, linear_swept_sphere, sphere, triangle,
};

/// Up to this many primitives are tested one by one, without boxes or tree: a node test and a
/// primitive's test cost about the same.
const LINEAR: usize = 4;

/// What a ray pays for a leaf and for each primitive in it, in visits of inner nodes: where each is
/// tested by itself, and where most of a block are dropped.
const SINGLY: (f32, f32) = (1.0, 3.0);
const DROPPED: (f32, f32) = (1.5, 0.25);
const SWEPT: (f32, f32) = (1.5, 0.4);

/// The active primitives of a BLAS, and the tree over them.
#[derive(Debug)]
pub struct Body {
    shapes: Shapes,
    /// By place in tree order; [`Name::NONE`] where a leaf is not full.
    names: Vec<Name>,
    /// Whether some primitives stand in several leaves.
    has_pieces: bool,
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
        Self::collect(geometries, true)
    }

    /// Collects the active primitives, and builds no tree however many there are.
    pub fn without_tree(geometries: &[Geometry]) -> Self {
        Self::collect(geometries, false)
    }

    fn collect(geometries: &[Geometry], may_build: bool) -> Self {
        if geometries.iter().any(|geometry| geometry.vertices_t1.is_some()) {
            return Self::collect_moving(geometries, may_build);
        }
        let count = geometries.iter().map(|geometry| geometry.data.primitive_count()).sum();
        let mut boxes = Vec::with_capacity(count);
        let mut names = Vec::with_capacity(count);
        for (geometry, Geometry { data, .. }) in geometries.iter().enumerate() {
            for primitive in 0..data.primitive_count() as u32 {
                let before = boxes.len();
                match data.primitive(primitive) {
                    Primitive::LinearSweptSphere { positions, radii, .. } if may_build && count > LINEAR => {
                        linear_swept_sphere::pieces(positions, radii, |piece| boxes.push(piece));
                    }
                    numbers => boxes.extend(bounds(&numbers)),
                }
                names.resize(
                    names.len() + boxes.len() - before,
                    Name { geometry: geometry as u32, primitive },
                );
            }
        }
        let (visit, primitive) = match geometries.first().map(|geometry| geometry.data.kind()) {
            Some(GeometryKind::Spheres | GeometryKind::Aabbs) => SINGLY,
            Some(GeometryKind::LinearSweptSpheres) => SWEPT,
            Some(GeometryKind::Triangles) | None => DROPPED,
        };
        let cost = may_build.then_some(LeafCost { most: LANES, visit, primitive });
        Self::around(geometries, &boxes, &names, cost, |_, names| {
            let at = |name: &Name| {
                (*name != Name::NONE)
                    .then(|| geometries[name.geometry as usize].data.primitive(name.primitive))
            };
            Shapes::of(names.len(), names.iter().map(at))
        })
    }

    /// The same for triangles of which some move. The interpolated coordinates of a vertex lie
    /// between those of its keys, so a box around both keys holds them all.
    #[cold]
    fn collect_moving(geometries: &[Geometry], may_build: bool) -> Self {
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
        let (visit, primitive) = SINGLY;
        let cost = may_build.then_some(LeafCost { most: LANES, visit, primitive });
        Self::around(geometries, &boxes, &names, cost, |order, _| {
            let at = |&number: &u32| all.get(number as usize).copied();
            Shapes::MovingTriangles(order.iter().map(at).collect())
        })
    }

    /// The tree over boxes, where it pays, and the shapes in its order.
    fn around(
        geometries: &[Geometry],
        boxes: &[Bounds],
        names: &[Name],
        cost: Option<LeafCost>,
        shapes: impl FnOnce(&[u32], &[Name]) -> Shapes,
    ) -> Self {
        let (tree, order) = match cost.filter(|_| boxes.len() > LINEAR) {
            None => (None, (0..boxes.len() as u32).collect()),
            Some(cost) => {
                let (tree, order) = Tree::build(boxes, cost).expect("bug in anyhit: a tree of no boxes");
                (Some(tree), order)
            }
        };
        let around = match &tree {
            Some(tree) => *tree.bounds(),
            None => boxes.iter().fold(Bounds::EMPTY, |all, one| all.union(one)),
        };
        let has_pieces = names.windows(2).any(|pair| pair[0] == pair[1]);
        let at = |&number: &u32| names.get(number as usize).copied().unwrap_or(Name::NONE);
        let names: Vec<Name> = order.iter().map(at).collect();
        let common_flags = geometries.first().map(|first| first.flags).filter(|&flags| {
            geometries.iter().all(|one| one.flags == flags && one.opacity_micromap.is_none())
        });
        Self { shapes: shapes(&order, &names), names, has_pieces, tree, bounds: around, common_flags }
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
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The tree; without one, all primitives are tested.
    #[inline]
    pub fn tree(&self) -> Option<&Tree> {
        self.tree.as_ref()
    }

    /// All primitives, for a body without a tree.
    pub fn leaves(&self) -> impl Iterator<Item = Child> + use<> {
        let count = self.names.len();
        (0..count.div_ceil(LANES)).map(move |index| Child::leaf(index, LANES.min(count - index * LANES)))
    }

    /// Which primitive a lane of a leaf is.
    #[inline(always)]
    pub fn name(&self, leaf: Child, lane: usize) -> Name {
        self.names[leaf.index() * LANES + lane]
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
            Shapes::LinearSweptSpheres(_) => Drops::Always,
            Shapes::Triangles(_) => Drops::WhereSimple,
            Shapes::Spheres(_) | Shapes::Aabbs(_) | Shapes::MovingTriangles(_) => Drops::Never,
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
        (1 << leaf.count()) - 1
    }

    /// A bit for each of a leaf's primitives that the ray's line does not surely miss. Only for bodies
    /// that [drop](Body::drops) some.
    #[inline(always)]
    pub fn met(&self, leaf: Child, ray: &BlockRay) -> u32 {
        let at = leaf.index();
        let met = match &self.shapes {
            Shapes::Triangles(blocks) => blocks[at].met(ray),
            Shapes::LinearSweptSpheres(blocks) => blocks[at].met(ray),
            Shapes::Spheres(_) | Shapes::Aabbs(_) | Shapes::MovingTriangles(_) => u32::MAX,
        };
        met & self.every(leaf)
    }

    /// Where a ray of a time meets the primitive in a leaf's lane, within the ray's whole interval.
    #[inline(always)]
    pub fn intersect(
        &self,
        (leaf, lane): (Child, usize),
        ray: &ObjectRay,
        time: f32,
        precision: Precision,
    ) -> Option<Intersection> {
        let at = leaf.index();
        match &self.shapes {
            Shapes::Triangles(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::Aabbs(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::Spheres(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::LinearSweptSpheres(blocks) => blocks[at].intersect(lane, ray, precision),
            Shapes::MovingTriangles(all) => moving(all[at * LANES + lane].as_ref()?, ray, time, precision),
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
    fn of(count: usize, mut places: impl Iterator<Item = Option<Primitive>> + Clone) -> Self {
        let count = count.div_ceil(LANES);
        let mut shapes = match places.clone().flatten().next() {
            Some(Primitive::Aabb(_)) => Self::Aabbs(vec![block::Aabbs::EMPTY; count]),
            Some(Primitive::Sphere { .. }) => Self::Spheres(vec![block::Spheres::EMPTY; count]),
            Some(Primitive::LinearSweptSphere { .. }) => {
                Self::LinearSweptSpheres(vec![block::LinearSweptSpheres::EMPTY; count])
            }
            Some(Primitive::Triangle(_)) | None => Self::Triangles(vec![block::Triangles::EMPTY; count]),
        };
        for (place, primitive) in places.by_ref().enumerate() {
            let (at, lane) = (place / LANES, place % LANES);
            match (&mut shapes, primitive) {
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
