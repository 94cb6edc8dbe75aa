//! What a BLAS is when rays reach it: active primitives in tree order, and the tree.

use crate::accel::blas::Geometry;
use crate::accel::primitive::Primitive;
use crate::accel::tree::Tree;
use crate::geometry::{
    Bounds, Intersection, ObjectRay, Precision, aabb, linear_swept_sphere, sphere, triangle,
};

/// Up to this many primitives are tested one by one, without boxes or tree: a node test and a
/// primitive's test cost about the same.
const LINEAR: usize = 4;

/// The most primitives of a leaf.
const LEAF: u32 = 4;

/// The active primitives of a BLAS, and the tree over them.
#[derive(Debug)]
pub struct Body {
    shapes: Shapes,
    /// Parallel to the shapes.
    names: Vec<Name>,
    tree: Option<Tree>,
    bounds: Bounds,
}

/// Which primitive of a BLAS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name {
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
}

/// Primitives of one kind.
#[derive(Debug)]
enum Shapes {
    Triangles(Vec<[[f32; 3]; 3]>),
    Aabbs(Vec<[f32; 6]>),
    Spheres(Vec<([f32; 3], f32)>),
    LinearSweptSpheres(Vec<LinearSweptSphere>),
}

#[derive(Clone, Copy, Debug)]
struct LinearSweptSphere {
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
    caps: [bool; 2],
}

impl Body {
    /// Collects the active primitives and builds the tree where it pays.
    pub fn build(geometries: &[Geometry]) -> Self {
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
        let around = boxes.iter().fold(Bounds::EMPTY, |all, one| all.union(one));
        if boxes.len() <= LINEAR {
            return Self { shapes: Shapes::of(&primitives), names, tree: None, bounds: around };
        }
        let (tree, order) = Tree::build(&boxes, LEAF).expect("bug in anyhit: a tree of no boxes");
        let ordered: Vec<Primitive> = order.iter().map(|&number| primitives[number as usize]).collect();
        let names = order.iter().map(|&number| names[number as usize]).collect();
        Self { shapes: Shapes::of(&ordered), names, tree: Some(tree), bounds: around }
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

    /// How many active primitives there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Which primitive stands at a place in tree order.
    #[inline]
    pub fn name(&self, place: usize) -> Name {
        self.names[place]
    }

    /// Where a ray meets the primitive at a place in tree order, within the ray's whole interval.
    #[inline]
    pub fn intersect(&self, place: usize, ray: &ObjectRay, precision: Precision) -> Option<Intersection> {
        match &self.shapes {
            Shapes::Triangles(all) => triangle::intersect(ray, all[place], precision),
            Shapes::Aabbs(all) => {
                let (min, max) = corners(all[place]);
                aabb::intersect(ray, min, max, precision)
            }
            Shapes::Spheres(all) => sphere::intersect(ray, all[place].0, all[place].1, precision),
            Shapes::LinearSweptSpheres(all) => {
                let one = &all[place];
                linear_swept_sphere::intersect(ray, one.positions, one.radii, one.caps, precision)
            }
        }
    }
}

impl Shapes {
    fn of(primitives: &[Primitive]) -> Self {
        let mut triangles = Vec::new();
        let mut aabbs = Vec::new();
        let mut spheres = Vec::new();
        let mut swept = Vec::new();
        for primitive in primitives {
            match *primitive {
                Primitive::Triangle(vertices) => triangles.push(vertices),
                Primitive::Aabb(corners) => aabbs.push(corners),
                Primitive::Sphere { position, radius } => spheres.push((position, radius)),
                Primitive::LinearSweptSphere { positions, radii, caps } => {
                    swept.push(LinearSweptSphere { positions, radii, caps });
                }
            }
        }
        // A BLAS holds one kind.
        match primitives.first() {
            Some(Primitive::Aabb(_)) => Self::Aabbs(aabbs),
            Some(Primitive::Sphere { .. }) => Self::Spheres(spheres),
            Some(Primitive::LinearSweptSphere { .. }) => Self::LinearSweptSpheres(swept),
            Some(Primitive::Triangle(_)) | None => Self::Triangles(triangles),
        }
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
