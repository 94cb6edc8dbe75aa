//! Collects the active primitives of geometries, with their boxes.

use crate::accel::build_threads::{BuildThreads, CHUNK};
use crate::accel::geometry::{Geometry, moves, primitive_count};
use crate::accel::geometry_data::{GeometryData, GeometryKind};
use crate::accel::prim_ref::PrimRef;
use crate::accel::primitive::{self, Primitive, PrimitiveVisitor};
use crate::accel::primitive_numbers::PrimitiveNumbers;
use crate::accel::unit_cube::bounds_around;
use crate::accel::wide_bvh::PADDING;
use crate::geometry::{Bounds, aabb, linear_swept_sphere, sphere, triangle};
use crate::math::array;
use crate::math::f32x4::F32x4;

/// Swept spheres are split into halves if a random line through all of them then hits fewer boxes
/// on average, by at least this factor times the square root of their number. Each is then in two
/// leaves, which cost cache space. (Measured over hay and meadows of 200 to 100,000.)
const MIN_SPLIT_GAIN: f64 = 0.1;

/// The greatest share of its surface that splitting a swept sphere saves: each half has half of its
/// extents, and a quarter of its surface. A little more, as boxes are rounded.
const MAX_SAVED: f64 = 0.51;

/// The active primitives in the order of their numbers.
pub(super) struct CollectedPrimitives {
    /// A box for each, with its number; two boxes for each that is split.
    pub boxes: Vec<PrimRef>,
    pub has_split_primitives: bool,
}

/// The numbers of the active primitives, and the box around all of them.
pub(super) fn active_primitives(geometries: &[Geometry], numbers: &PrimitiveNumbers) -> (Vec<u32>, Bounds) {
    if moves(geometries) {
        let boxes = CollectedPrimitives::new(geometries, numbers, BuildThreads::One).boxes;
        let bounds = bounds_around(&boxes, BuildThreads::One);
        return (boxes.iter().map(PrimRef::number).collect(), bounds);
    }
    let order = Vec::with_capacity(primitive_count(geometries));
    let mut collector = NumberCollector { first: 0, order, around: PrimRef::EMPTY };
    for (number, geometry) in geometries.iter().enumerate() {
        collector.first = numbers.first_of(number);
        geometry.data.visit_primitives(&mut collector);
    }
    (collector.order, collector.around.bounds())
}

/// The box around all active primitives, none of which moves.
pub(super) fn bounds_of(geometries: &[Geometry]) -> Bounds {
    let mut around = BoundsCollector(PrimRef::EMPTY);
    for geometry in geometries {
        geometry.data.visit_primitives(&mut around);
    }
    around.0.bounds()
}

/// Accumulates the box around all active primitives.
struct BoundsCollector(PrimRef);

impl PrimitiveVisitor for BoundsCollector {
    #[inline(always)]
    fn visit(&mut self, _: u32, primitive_data: Primitive) {
        if let Some(one) = prim_ref(&primitive_data) {
            self.0 = self.0.union(&one);
        }
    }
}

/// Collects the numbers of the active primitives, and the box around all of them.
struct NumberCollector {
    /// The number of the first primitive of the geometry.
    first: u32,
    order: Vec<u32>,
    around: PrimRef,
}

impl PrimitiveVisitor for NumberCollector {
    #[inline(always)]
    fn visit(&mut self, primitive: u32, primitive_data: Primitive) {
        if let Some(one) = prim_ref(&primitive_data) {
            self.around = self.around.union(&one);
            self.order.push(self.first + primitive);
        }
    }
}

/// Adds up the surface area that splitting swept spheres saves.
struct SavedArea(f64);

impl PrimitiveVisitor for SavedArea {
    #[inline(always)]
    fn visit(&mut self, _: u32, primitive_data: Primitive) {
        if let Primitive::LinearSweptSphere { positions, radii, .. } = primitive_data
            && let Some([first, second]) = linear_swept_sphere::halves(positions, radii)
            && let Some(whole) = linear_swept_sphere::bounds(positions, radii)
        {
            self.0 += whole.surface() - first.surface() - second.surface();
        }
    }
}

impl CollectedPrimitives {
    /// Collects the active primitives.
    pub(super) fn new(geometries: &[Geometry], numbers: &PrimitiveNumbers, threads: BuildThreads) -> Self {
        let boxes = boxes(geometries, numbers, threads);
        let swept = geometries.first().map(|one| one.data.kind()) == Some(GeometryKind::LinearSweptSpheres);
        if !swept || !splitting_pays(geometries, &boxes, threads) {
            return Self { boxes, has_split_primitives: false };
        }
        let count = boxes.len();
        // Of many primitives both lists take more memory than all that follows.
        drop(boxes);
        let boxes = boxes_of_halves(geometries, numbers, threads);
        let has_split_primitives = boxes.len() > count;
        Self { boxes, has_split_primitives }
    }
}

/// The boxes of the active primitives with their numbers.
fn boxes(geometries: &[Geometry], numbers: &PrimitiveNumbers, threads: BuildThreads) -> Vec<PrimRef> {
    let mut boxes = Vec::with_capacity(primitive_count(geometries));
    for (number, geometry) in geometries.iter().enumerate() {
        let first = numbers.first_of(number);
        let count = geometry.data.primitive_count();
        if geometry.vertices_t1.is_some() {
            let one = |at: u32| numbered(moving_prim_ref(geometry, at), first + at);
            threads.extend(&mut boxes, count, |at| one(at as u32));
            continue;
        }
        // Each kind has a loop of its own.
        match &geometry.data {
            GeometryData::Triangles { vertices, indices, transform } => {
                threads.extend(&mut boxes, count, |at| {
                    let triangle = primitive::triangle(vertices, indices, transform, at as u32);
                    numbered(triangle_prim_ref(triangle), first + at as u32)
                });
            }
            GeometryData::Aabbs(all) => threads.extend(&mut boxes, count, |at| {
                numbered(prim_ref(&Primitive::Aabb(all[at])), first + at as u32)
            }),
            GeometryData::Spheres { positions, radii, indices } => {
                threads.extend(&mut boxes, count, |at| {
                    let sphere = primitive::sphere(positions, radii, indices, at);
                    numbered(prim_ref(&sphere), first + at as u32)
                });
            }
            GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, .. } => {
                threads.extend(&mut boxes, count, |at| {
                    let ends = primitive::end_vertices(indices, *indexing, at);
                    let (positions, radii) =
                        (array::map(ends, |end| positions[end]), array::map(ends, |end| radii[end]));
                    let bounds = linear_swept_sphere::bounds(positions, radii);
                    numbered(bounds.map(|bounds| PrimRef::new(&bounds, 0)), first + at as u32)
                });
            }
        }
    }
    keep_active(&mut boxes, threads);
    boxes
}

/// [`boxes`] of swept spheres, two for each whose halves have less surface.
fn boxes_of_halves(
    geometries: &[Geometry],
    numbers: &PrimitiveNumbers,
    threads: BuildThreads,
) -> Vec<PrimRef> {
    let mut pairs = Vec::with_capacity(primitive_count(geometries));
    for (number, geometry) in geometries.iter().enumerate() {
        let first = numbers.first_of(number);
        threads.extend(&mut pairs, geometry.data.primitive_count(), |at| {
            let halves = match geometry.data.primitive(at as u32) {
                Primitive::LinearSweptSphere { positions, radii, .. } => {
                    match linear_swept_sphere::halves(positions, radii) {
                        Some(halves) => array::map(halves, Some),
                        None => [linear_swept_sphere::bounds(positions, radii), None],
                    }
                }
                _ => [None; 2],
            };
            halves.map(|half| numbered(half.map(|half| PrimRef::new(&half, 0)), first + at as u32))
        });
    }
    let mut boxes = pairs.into_flattened();
    keep_active(&mut boxes, threads);
    boxes
}

/// A box with a number; in place of no box one that [`keep_active`] removes.
#[inline(always)]
fn numbered(one: Option<PrimRef>, number: u32) -> PrimRef {
    match one {
        Some(one) => one.with_number(number),
        None => PrimRef::EMPTY.with_number(PADDING),
    }
}

/// Removes what stands for inactive primitives.
fn keep_active(boxes: &mut Vec<PrimRef>, threads: BuildThreads) {
    let is_inactive = |one: &PrimRef| one.number() == PADDING;
    let chunks = boxes.chunks(CHUNK).collect();
    if threads.map(chunks, |chunk: &[PrimRef]| chunk.iter().any(is_inactive)).contains(&true) {
        boxes.retain(|one| !is_inactive(one));
    }
}

/// Whether a random line hits enough fewer boxes once swept spheres are split into halves.
fn splitting_pays(geometries: &[Geometry], boxes: &[PrimRef], threads: BuildThreads) -> bool {
    let least = MIN_SPLIT_GAIN * (boxes.len() as f64).sqrt() * bounds_around(boxes, threads).surface();
    let area = |chunk: &[PrimRef]| chunk.iter().map(|one| one.bounds().surface()).sum::<f64>();
    let swept_area: f64 = threads.map(boxes.chunks(CHUNK).collect(), area).iter().sum();
    if swept_area <= 0.0 || MAX_SAVED * swept_area < least {
        return false;
    }
    let mut saved = SavedArea(0.0);
    geometries.iter().for_each(|geometry| geometry.data.visit_primitives(&mut saved));
    saved.0 > 0.0 && saved.0 >= least
}

/// The box around a triangle that may move. The interpolated coordinates of a vertex lie between
/// those of its keys.
#[cold]
fn moving_prim_ref(geometry: &Geometry, primitive: u32) -> Option<PrimRef> {
    let [first, second] = array::map(geometry.keys(primitive)?, triangle::bounds);
    Some(PrimRef::new(&first?.union(&second?), 0))
}

/// The box around a primitive, with number 0; `None` if it is inactive or can never be hit.
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

/// [`triangle::bounds`] in SIMD.
#[inline(always)]
fn triangle_prim_ref(vertices: [[f32; 3]; 3]) -> Option<PrimRef> {
    let [a, b, c] = array::map(vertices, |[x, y, z]| F32x4::new([x, y, z, 0.0]));
    // Zero times an infinity or a NaN is a NaN.
    let finite = (a * F32x4::ZERO + b * F32x4::ZERO + c * F32x4::ZERO).cmp_ge(F32x4::ZERO) == 0b1111;
    let (low, high) = (a.relaxed_min(b).relaxed_min(c), a.relaxed_max(b).relaxed_max(c));
    finite.then(|| PrimRef::from_corners([low, F32x4::ZERO - high], 0))
}

/// The minimum and the maximum corner of a box as given.
#[inline]
pub(super) fn corners([x0, y0, z0, x1, y1, z1]: [f32; 6]) -> ([f32; 3], [f32; 3]) {
    ([x0, y0, z0], [x1, y1, z1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::flags::GeometryFlags;

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

    #[test]
    fn inactive_primitives_are_left_out() {
        // Every third triangle has a NaN; of the second geometry all have.
        let triangles = |count: usize, every: usize| {
            let coordinate = |at: usize| if (at / 9).is_multiple_of(every) { f32::NAN } else { at as f32 };
            let vertices = (0..3 * count).map(|vertex| [0, 1, 2].map(|axis| coordinate(3 * vertex + axis)));
            let data =
                GeometryData::Triangles { vertices: vertices.collect(), indices: None, transform: None };
            Geometry::new(data, GeometryFlags::OPAQUE)
        };
        let geometries = [triangles(7, 3), triangles(4, 1), triangles(2 * CHUNK, 3)];
        let numbers = PrimitiveNumbers::new(&geometries);
        let primitives = [(0, 7), (11, 2 * CHUNK as u32)];
        let wanted: Vec<u32> = primitives
            .iter()
            .flat_map(|&(first, count)| (0..count).filter(|at| at % 3 != 0).map(move |at| first + at))
            .collect();
        let found = |threads| {
            let collected = CollectedPrimitives::new(&geometries, &numbers, threads);
            collected.boxes.iter().map(PrimRef::number).collect::<Vec<_>>()
        };
        assert_eq!(found(BuildThreads::One), wanted);
        assert_eq!(BuildThreads::build_in_pool(3, found), wanted);
        assert_eq!(active_primitives(&geometries, &numbers).0, wanted);
    }
}
