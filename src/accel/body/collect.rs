//! The making of a body: reads the active primitives of geometries, builds the tree over their boxes
//! where it pays, and puts them down in its order.

use crate::accel::binned_sah::{PrimRef, SahCost};
use crate::accel::blas::{Geometry, GeometryFlags};
use crate::accel::body::{Body, Name, Shapes};
use crate::accel::geometry_data::{GeometryData, GeometryKind};
use crate::accel::primitive::{self, Primitive, TakePrimitive};
use crate::accel::wide_bvh::WideBvh;
use crate::geometry::block::{self, LANES};
use crate::geometry::{Bounds, aabb, linear_swept_sphere, sphere, triangle};
use crate::math::four::Four;

/// Up to this many primitives are tested one by one, without boxes or tree: a node test and a
/// primitive's test cost about the same.
const LINEAR: usize = 4;

/// What a ray pays for a leaf and for each primitive in it, in visits of inner nodes: where each is
/// tested by itself, where a block is tested at once, and where most of one are dropped. Triangles stand four
/// in a leaf unless they gain much by being apart: a block takes as much memory whatever is in it.
const SINGLY: SahCost = SahCost { max_leaf_size: LANES, traversal: 1.0, intersection: 3.0, split_below: 1.0 };
const AT_ONCE: SahCost = SahCost { intersection: 0.15, ..SINGLY };
const TRIANGLES: SahCost = SahCost { intersection: 0.05, split_below: 0.8, ..SINGLY };
const SWEPT: SahCost = SahCost { traversal: 1.5, intersection: 0.2, split_below: 0.8, ..SINGLY };

/// Swept spheres are halved where a line through all of them meets fewer boxes then, on the average: so many times the root of
/// their number. Each stands in two leaves, and those do not fit into a processor's caches as long as one does.
/// (Measured over hay and meadows of 200 to 100,000.)
const FEWER_BOXES: f64 = 0.1;

/// The primitives that a body is made of, in the order in which they were given.
#[derive(Default)]
struct Collected {
    /// Numbered by place; none where there will be no tree.
    boxes: Vec<PrimRef>,
    names: Vec<Name>,
    bounds: Option<Bounds>,
    has_pieces: bool,
}

impl Body {
    /// Collects the active primitives and builds the tree where it pays.
    pub fn build(geometries: &[Geometry]) -> Self {
        Self::collect(geometries, true)
    }

    /// Collects the active primitives, and builds no tree however many there are.
    pub fn without_bvh(geometries: &[Geometry]) -> Self {
        Self::collect(geometries, false)
    }

    fn collect(geometries: &[Geometry], may_build: bool) -> Self {
        if geometries.iter().any(|geometry| geometry.vertices_t1.is_some()) {
            return Self::collect_moving(geometries, may_build);
        }
        let count: usize = geometries.iter().map(|geometry| geometry.data.primitive_count()).sum();
        let has_bvh = may_build && count > LINEAR;
        let collected =
            if has_bvh { Collected::boxed(geometries, count) } else { Collected::listed(geometries, count) };
        let cost = match geometries.first().map(|geometry| geometry.data.kind()) {
            Some(GeometryKind::Aabbs) => SINGLY,
            Some(GeometryKind::Spheres) => AT_ONCE,
            Some(GeometryKind::LinearSweptSpheres) => SWEPT,
            Some(GeometryKind::Triangles) | None => TRIANGLES,
        };
        Self::around(geometries, collected, cost, |_, names| Shapes::of(geometries, names))
    }

    /// The same for triangles of which some move. The interpolated coordinates of a vertex lie
    /// between those of its keys, so a box around both keys holds them all.
    #[cold]
    fn collect_moving(geometries: &[Geometry], may_build: bool) -> Self {
        let mut all = Vec::new();
        let mut collected = Collected::default();
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
                    collected.push(PrimRef::new(&bounds, 0), Name { geometry: number as u32, primitive });
                }
            }
        }
        if !may_build || collected.boxes.len() <= LINEAR {
            collected.forget_boxes();
        }
        Self::around(geometries, collected, SINGLY, |order, _| {
            let at = |&number: &u32| all.get(number as usize).copied();
            Shapes::MovingTriangles(order.iter().map(at).collect())
        })
    }

    /// The tree over boxes, where there are any, and the shapes in its order.
    fn around(
        geometries: &[Geometry],
        collected: Collected,
        cost: SahCost,
        shapes: impl FnOnce(&[u32], &[Name]) -> Shapes,
    ) -> Self {
        let Collected { boxes, mut names, bounds, has_pieces } = collected;
        let (bvh, order) = match WideBvh::over(boxes, cost) {
            None => (None, (0..names.len() as u32).collect()),
            Some((bvh, order)) => {
                let at = |&number: &u32| names.get(number as usize).copied().unwrap_or(Name::NONE);
                names = order.iter().map(at).collect();
                (Some(bvh), order)
            }
        };
        let bounds = bvh.as_ref().map(|bvh| *bvh.bounds()).or(bounds).unwrap_or(Bounds::EMPTY);
        let common_flags = geometries.first().map(|first| first.flags).filter(|&flags: &GeometryFlags| {
            geometries.iter().all(|one| one.flags == flags && one.opacity_micromap.is_none())
        });
        Self { shapes: shapes(&order, &names), names, has_pieces, bvh, bounds, common_flags }
    }

    /// The box around all active primitives, without building anything.
    pub fn bounds_of(geometries: &[Geometry]) -> Bounds {
        let mut around = Around(PrimRef::EMPTY);
        geometries.iter().for_each(|geometry| geometry.data.each_primitive(&mut around));
        around.0.bounds()
    }
}

/// The box around all active primitives.
struct Around(PrimRef);

impl TakePrimitive for Around {
    #[inline(always)]
    fn take(&mut self, _: u32, numbers: Primitive) {
        if let Some(one) = prim_ref(&numbers) {
            self.0 = self.0.union(&one);
        }
    }
}

/// The active primitives, and the box around all.
struct Listed {
    geometry: u32,
    names: Vec<Name>,
    around: Around,
}

impl TakePrimitive for Listed {
    #[inline(always)]
    fn take(&mut self, primitive: u32, numbers: Primitive) {
        if let Some(one) = prim_ref(&numbers) {
            self.around.0 = self.around.0.union(&one);
            self.names.push(Name { geometry: self.geometry, primitive });
        }
    }
}

/// The active primitives with their boxes.
struct Boxed {
    geometry: u32,
    all: Collected,
    /// Whether those are halved that are smaller then.
    halved: bool,
    /// How much surface that saves, or would save.
    saved: f64,
}

impl Boxed {
    /// All primitives of geometries that have so many boxes at most.
    fn taken(geometries: &[Geometry], most: usize, halved: bool) -> Self {
        let (boxes, names) = (Vec::with_capacity(most), Vec::with_capacity(most));
        let all = Collected { boxes, names, ..Collected::default() };
        let mut taken = Self { geometry: 0, all, halved, saved: 0.0 };
        for (number, geometry) in geometries.iter().enumerate() {
            taken.geometry = number as u32;
            geometry.data.each_primitive(&mut taken);
        }
        taken
    }
}

impl TakePrimitive for Boxed {
    #[inline(always)]
    fn take(&mut self, primitive: u32, numbers: Primitive) {
        let name = Name { geometry: self.geometry, primitive };
        match numbers {
            Primitive::LinearSweptSphere { positions, radii, .. } => {
                let Some(whole) = linear_swept_sphere::bounds(positions, radii) else { return };
                let halves = linear_swept_sphere::halves(positions, radii);
                if let Some([first, second]) = &halves {
                    self.saved += whole.surface() - first.surface() - second.surface();
                }
                match halves.filter(|_| self.halved) {
                    None => self.all.push(PrimRef::new(&whole, 0), name),
                    Some(halves) => {
                        halves.iter().for_each(|half| self.all.push(PrimRef::new(half, 0), name));
                        self.all.has_pieces = true;
                    }
                }
            }
            numbers => {
                if let Some(one) = prim_ref(&numbers) {
                    self.all.push(one, name);
                }
            }
        }
    }
}

impl Collected {
    /// The primitives with their boxes.
    fn boxed(geometries: &[Geometry], count: usize) -> Self {
        let Boxed { all, saved, .. } = Boxed::taken(geometries, count, false);
        let fewer = FEWER_BOXES * (all.boxes.len() as f64).sqrt();
        if saved > 0.0 && saved >= fewer * all.around().surface() {
            return Boxed::taken(geometries, 2 * count, true).all;
        }
        all
    }

    /// The primitives alone, and the box around all.
    fn listed(geometries: &[Geometry], count: usize) -> Self {
        let mut taken =
            Listed { geometry: 0, names: Vec::with_capacity(count), around: Around(PrimRef::EMPTY) };
        for (number, geometry) in geometries.iter().enumerate() {
            taken.geometry = number as u32;
            geometry.data.each_primitive(&mut taken);
        }
        Self { names: taken.names, bounds: Some(taken.around.0.bounds()), ..Self::default() }
    }

    #[inline(always)]
    fn push(&mut self, one: PrimRef, name: Name) {
        self.boxes.push(one.with_number(self.boxes.len() as u32));
        self.names.push(name);
    }

    /// The box around all.
    fn around(&self) -> Bounds {
        self.boxes.iter().fold(PrimRef::EMPTY, |all, one| all.union(one)).bounds()
    }

    /// Makes it one without tree.
    fn forget_boxes(&mut self) {
        self.bounds = Some(self.around());
        self.boxes.clear();
    }
}

impl Shapes {
    /// Takes primitives of one kind by place; some places are empty.
    fn of(geometries: &[Geometry], names: &[Name]) -> Self {
        let data = |name: &Name| &geometries[name.geometry as usize].data;
        match geometries.first().map(|geometry| geometry.data.kind()) {
            Some(GeometryKind::Triangles) | None => {
                Self::Triangles(blocks(names, block::Triangles::EMPTY, |block, lane, name| {
                    let GeometryData::Triangles { vertices, indices, transform } = data(name) else {
                        mixed()
                    };
                    block.set(lane, primitive::triangle(vertices, indices, transform, name.primitive));
                }))
            }
            Some(GeometryKind::Aabbs) => {
                Self::Aabbs(blocks(names, block::Aabbs::EMPTY, |block, lane, name| {
                    let GeometryData::Aabbs(boxes) = data(name) else { mixed() };
                    let (min, max) = corners(boxes[name.primitive as usize]);
                    block.set(lane, min, max);
                }))
            }
            Some(GeometryKind::Spheres) => {
                Self::Spheres(blocks(names, block::Spheres::EMPTY, |block, lane, name| {
                    let GeometryData::Spheres { positions, radii, indices } = data(name) else { mixed() };
                    let sphere = primitive::sphere(positions, radii, indices, name.primitive as usize);
                    if let Primitive::Sphere { position, radius } = sphere {
                        block.set(lane, position, radius);
                    }
                }))
            }
            Some(GeometryKind::LinearSweptSpheres) => {
                let ends = blocks(names, block::SweptEnds::EMPTY, |block, lane, name| {
                    let GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, .. } =
                        data(name)
                    else {
                        mixed()
                    };
                    let ends = primitive::ends(indices, *indexing, name.primitive as usize);
                    block.set(lane, ends.map(|end| positions[end]), ends.map(|end| radii[end]));
                });
                let caps = blocks(names, [[false; 2]; LANES], |caps, lane, name| {
                    let GeometryData::LinearSweptSpheres { indices, indexing, end_caps, .. } = data(name)
                    else {
                        mixed()
                    };
                    let at = name.primitive as usize;
                    caps[lane] = primitive::caps(indices.as_deref(), *indexing, *end_caps, at);
                });
                Self::LinearSweptSpheres(ends, caps)
            }
        }
    }
}

/// Blocks of which each lane that has a primitive is set.
fn blocks<B: Clone>(names: &[Name], empty: B, set: impl Fn(&mut B, usize, &Name)) -> Vec<B> {
    let mut blocks = Vec::with_capacity(names.len().div_ceil(LANES));
    for names in names.chunks(LANES) {
        let mut block = empty.clone();
        for lane in 0..LANES {
            if let Some(name) = names.get(lane).filter(|&&name| name != Name::NONE) {
                set(&mut block, lane, name);
            }
        }
        blocks.push(block);
    }
    blocks
}

#[cold]
fn mixed() -> ! {
    unreachable!("bug in anyhit: a BLAS of two kinds of primitive")
}

/// The box around a primitive, numbered 0; `None` where it is inactive or can never be hit.
#[inline(always)]
fn prim_ref(primitive: &Primitive) -> Option<PrimRef> {
    let bounds = match *primitive {
        Primitive::Triangle(vertices) => return triangle_prim_ref(vertices),
        Primitive::Aabb(minimum_maximum) => {
            let (min, max) = corners(minimum_maximum);
            aabb::bounds(min, max)
        }
        Primitive::Sphere { position, radius } => sphere::bounds(position, radius),
        Primitive::LinearSweptSphere { positions, radii, .. } => {
            linear_swept_sphere::bounds(positions, radii)
        }
    };
    bounds.map(|bounds| PrimRef::new(&bounds, 0))
}

/// [`triangle::bounds`] in vectors.
#[inline(always)]
fn triangle_prim_ref(vertices: [[f32; 3]; 3]) -> Option<PrimRef> {
    let [a, b, c] = vertices.map(|[x, y, z]| Four::new([x, y, z, 0.0]));
    // Zero times what is not finite is no number.
    let finite = (a * Four::ZERO + b * Four::ZERO + c * Four::ZERO).at_least(Four::ZERO) == 0b1111;
    let (low, high) = (a.lesser(b).lesser(c), a.greater(b).greater(c));
    finite.then(|| PrimRef::from_corners([low, Four::ZERO - high], 0))
}

#[inline]
fn corners([x0, y0, z0, x1, y1, z1]: [f32; 6]) -> ([f32; 3], [f32; 3]) {
    ([x0, y0, z0], [x1, y1, z1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::geometry_data::{EndCaps, Indexing};

    #[test]
    fn a_box_in_vectors_is_that_of_the_triangle() {
        let numbers = [0.0, -1.5, 3e38, -3e38, 1e-45, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        for at in 0..8 * 8 * 8 {
            let number = |shift: usize| numbers[(at / [1, 8, 64][shift % 3] + shift) % 8];
            let vertices = [0, 3, 6].map(|vertex| [0, 1, 2].map(|axis| number(vertex + axis)));
            let wanted = triangle::bounds(vertices);
            assert_eq!(triangle_prim_ref(vertices).map(|one| one.bounds()), wanted, "{vertices:?}");
        }
    }

    /// Rods of a length along the diagonals of a cube of ten, spread evenly (Kronecker's sequence).
    fn rods(count: u32, length: f32) -> Geometry {
        let side = length / 3f32.sqrt();
        let mut positions = Vec::new();
        for at in 0..count {
            let from = [0.819_172_5, 0.671_043_6, 0.549_700_5].map(|by: f32| 10.0 * (at as f32 * by).fract());
            positions.push(from);
            positions.push([0, 1, 2].map(|axis| from[axis] + if at >> axis & 1 == 0 { side } else { -side }));
        }
        let radii = vec![1e-4; positions.len()];
        let (indexing, end_caps) = (Indexing::List, EndCaps::Chained);
        let data = GeometryData::LinearSweptSpheres { positions, radii, indices: None, indexing, end_caps };
        Geometry::new(data, GeometryFlags::OPAQUE)
    }

    #[test]
    fn swept_spheres_are_halved_where_lines_meet_fewer_boxes_then() {
        let count = |body: &Body| body.names.iter().filter(|&&name| name != Name::NONE).count();
        // With length l a box has the surface 2 l^2, two halves have half of that, and the box around all at most
        // 6 (10 + 2 l / sqrt 3)^2: a line meets 400 l^2 / 6 (10 + 2 l / sqrt 3)^2 boxes fewer or more. It takes 0.1 sqrt 400.
        let dense = Body::build(&[rods(400, 5.0)]);
        assert!(dense.has_pieces(), "6.7 fewer");
        assert_eq!(count(&dense), 800);
        // And here at most 400 l^2 / 6 9^2, as all rods begin in more than a cube of nine.
        let sparse = Body::build(&[rods(400, 0.6)]);
        assert!(!sparse.has_pieces(), "0.3 fewer");
        assert_eq!(count(&sparse), 400);
    }
}
