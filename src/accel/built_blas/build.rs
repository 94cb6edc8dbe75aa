//! Builds a [`BuiltBlas`]: collects the active primitives of the geometries, builds the BVH over
//! their boxes if it pays, and stores the primitives in its order.

use crate::accel::binned_sah::{PrimRef, SahCost};
use crate::accel::built_blas::{BuiltBlas, GeomPrim, PrimitiveBlocks};
use crate::accel::flags::GeometryFlags;
use crate::accel::geometry::{Geometry, primitive_count};
use crate::accel::geometry_data::{GeometryData, GeometryKind};
use crate::accel::primitive::{self, Primitive, PrimitiveVisitor};
use crate::accel::wide_bvh::WideBvh;
use crate::geometry::block::{self, LANES};
use crate::geometry::{Bounds, aabb, linear_swept_sphere, sphere, triangle};
use crate::math::f32x4::F32x4;

/// Up to this many primitives are tested without a BVH: the test of a node costs about as much as
/// that of a primitive.
const MAX_WITHOUT_BVH: usize = 4;

/// SAH costs in units of one node test: of primitives that are tested one by one, of blocks that
/// are tested at once (spheres, triangles), and of blocks most of which are culled (swept spheres).
/// Triangles fill leaves of four unless splitting gains much, as a block takes the same memory
/// however full it is.
const COST_OF_SINGLE_TESTS: SahCost =
    SahCost { max_leaf_size: LANES, traversal: 1.0, intersection: 3.0, split_below: 1.0 };
const COST_OF_BLOCK_TESTS: SahCost = SahCost { intersection: 0.15, ..COST_OF_SINGLE_TESTS };
const COST_OF_TRIANGLES: SahCost = SahCost { intersection: 0.05, split_below: 0.8, ..COST_OF_SINGLE_TESTS };
const COST_OF_SWEPT_SPHERES: SahCost =
    SahCost { traversal: 1.5, intersection: 0.2, split_below: 0.8, ..COST_OF_SINGLE_TESTS };

/// Swept spheres are split into halves if a random line through all of them then hits fewer boxes
/// on average, by at least this factor times the square root of their number. Each is then in two
/// leaves, which cost cache space. (Measured over hay and meadows of 200 to 100,000.)
const MIN_SPLIT_GAIN: f64 = 0.1;

/// The greatest share of its surface that splitting a swept sphere saves: each half has half of its
/// extents, and a quarter of its surface. A little more, as boxes are rounded.
const MAX_SAVED: f64 = 0.51;

/// The active primitives in the order of the geometries.
#[derive(Default)]
pub(super) struct CollectedPrimitives {
    /// Numbered by position in `geom_prims`; empty if there will be no BVH.
    pub boxes: Vec<PrimRef>,
    pub geom_prims: Vec<GeomPrim>,
    bounds: Option<Bounds>,
    pub has_split_primitives: bool,
}

/// The costs of the tree over geometries.
pub(super) fn cost_of(geometries: &[Geometry]) -> SahCost {
    match geometries.first().map(|geometry| geometry.data.kind()) {
        Some(GeometryKind::Aabbs) => COST_OF_SINGLE_TESTS,
        Some(GeometryKind::Spheres) => COST_OF_BLOCK_TESTS,
        Some(GeometryKind::LinearSweptSpheres) => COST_OF_SWEPT_SPHERES,
        Some(GeometryKind::Triangles) | None => COST_OF_TRIANGLES,
    }
}

/// The flags of all geometries, if they agree and none has a micromap.
pub(super) fn common_flags(geometries: &[Geometry]) -> Option<GeometryFlags> {
    let flags = geometries.first()?.flags;
    let agrees = |one: &Geometry| one.flags == flags && one.opacity_micromap.is_none();
    geometries.iter().all(agrees).then_some(flags)
}

impl BuiltBlas {
    /// Collects the active primitives and builds the BVH if it pays.
    pub(crate) fn build(geometries: &[Geometry]) -> Self {
        Self::collect(geometries, true)
    }

    /// Collects the active primitives without building a BVH, however many there are.
    pub(crate) fn without_bvh(geometries: &[Geometry]) -> Self {
        Self::collect(geometries, false)
    }

    fn collect(geometries: &[Geometry], may_build: bool) -> Self {
        if geometries.iter().any(|geometry| geometry.vertices_t1.is_some()) {
            return Self::collect_moving(geometries, may_build);
        }
        let count = primitive_count(geometries);
        let has_bvh = may_build && count > MAX_WITHOUT_BVH;
        let collected = if has_bvh {
            CollectedPrimitives::with_boxes(geometries, count)
        } else {
            CollectedPrimitives::without_boxes(geometries, count)
        };
        Self::assemble(geometries, collected, cost_of(geometries), |_, geom_prims| {
            PrimitiveBlocks::of(geometries, geom_prims)
        })
    }

    /// [`Self::collect`] for triangles of which some move. The interpolated coordinates of a vertex
    /// lie between those of its keys, so a box around both keys contains them all.
    #[cold]
    fn collect_moving(geometries: &[Geometry], may_build: bool) -> Self {
        let mut all = Vec::new();
        let mut collected = CollectedPrimitives::default();
        for (number, geometry) in geometries.iter().enumerate() {
            for primitive in 0..geometry.data.primitive_count() as u32 {
                let keys =
                    geometry.motion_keys(primitive).or_else(|| match geometry.data.primitive(primitive) {
                        Primitive::Triangle(vertices) => Some([vertices; 2]),
                        _ => None,
                    });
                let bounds = keys.and_then(|[first, second]| {
                    Some(triangle::bounds(first)?.union(&triangle::bounds(second)?))
                });
                if let (Some(keys), Some(bounds)) = (keys, bounds) {
                    all.push(keys);
                    collected.push(PrimRef::new(&bounds, 0), GeomPrim { geometry: number as u32, primitive });
                }
            }
        }
        if !may_build || collected.boxes.len() <= MAX_WITHOUT_BVH {
            collected.clear_boxes();
        }
        Self::assemble(geometries, collected, COST_OF_SINGLE_TESTS, |order, _| {
            let at = |&number: &u32| all.get(number as usize).copied();
            PrimitiveBlocks::MovingTriangles(order.iter().map(at).collect())
        })
    }

    /// Builds the BVH over the boxes, if there are any, and stores the shapes in its order.
    fn assemble(
        geometries: &[Geometry],
        collected: CollectedPrimitives,
        cost: SahCost,
        blocks: impl FnOnce(&[u32], &[GeomPrim]) -> PrimitiveBlocks,
    ) -> Self {
        let CollectedPrimitives { boxes, mut geom_prims, bounds, has_split_primitives } = collected;
        let (bvh, order) = match WideBvh::from_prim_refs(boxes, cost) {
            None => (None, (0..geom_prims.len() as u32).collect()),
            Some((bvh, order)) => {
                let at = |&number: &u32| geom_prims.get(number as usize).copied().unwrap_or(GeomPrim::NONE);
                geom_prims = order.iter().map(at).collect();
                (Some(bvh), order)
            }
        };
        let bounds = bvh.as_ref().map(|bvh| *bvh.bounds()).or(bounds).unwrap_or(Bounds::EMPTY);
        Self {
            blocks: blocks(&order, &geom_prims),
            geom_prims,
            has_split_primitives,
            bvh,
            bounds,
            common_flags: common_flags(geometries),
        }
    }

    /// The box around all active primitives, computed without building anything.
    pub(crate) fn bounds_of(geometries: &[Geometry]) -> Bounds {
        let mut around = BoundsCollector(PrimRef::EMPTY);
        geometries.iter().for_each(|geometry| geometry.data.visit_primitives(&mut around));
        around.0.bounds()
    }
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

/// Collects the active primitives, and the box around all of them.
struct IdCollector {
    geometry: u32,
    geom_prims: Vec<GeomPrim>,
    around: BoundsCollector,
}

impl PrimitiveVisitor for IdCollector {
    #[inline(always)]
    fn visit(&mut self, primitive: u32, primitive_data: Primitive) {
        if let Some(one) = prim_ref(&primitive_data) {
            self.around.0 = self.around.0.union(&one);
            self.geom_prims.push(GeomPrim { geometry: self.geometry, primitive });
        }
    }
}

/// Collects the active primitives with their boxes.
struct PrimRefCollector {
    geometry: u32,
    all: CollectedPrimitives,
    /// Whether swept spheres whose halves have less surface are split.
    split_swept: bool,
    /// The surface area of all swept spheres.
    swept_area: f64,
}

impl PrimRefCollector {
    /// Collects all primitives of the geometries, which have at most `max_boxes` boxes.
    fn collect(geometries: &[Geometry], max_boxes: usize, split_swept: bool) -> Self {
        let (boxes, geom_prims) = (Vec::with_capacity(max_boxes), Vec::with_capacity(max_boxes));
        let all = CollectedPrimitives { boxes, geom_prims, ..CollectedPrimitives::default() };
        let mut collector = Self { geometry: 0, all, split_swept, swept_area: 0.0 };
        for (number, geometry) in geometries.iter().enumerate() {
            collector.geometry = number as u32;
            geometry.data.visit_primitives(&mut collector);
        }
        collector
    }
}

impl PrimitiveVisitor for PrimRefCollector {
    #[inline(always)]
    fn visit(&mut self, primitive: u32, primitive_data: Primitive) {
        let geom_prim = GeomPrim { geometry: self.geometry, primitive };
        match primitive_data {
            Primitive::LinearSweptSphere { positions, radii, .. } => {
                let Some(whole) = linear_swept_sphere::bounds(positions, radii) else { return };
                self.swept_area += whole.surface();
                let halves = self.split_swept.then(|| linear_swept_sphere::halves(positions, radii));
                match halves.flatten() {
                    None => self.all.push(PrimRef::new(&whole, 0), geom_prim),
                    Some(halves) => {
                        halves.iter().for_each(|half| self.all.push(PrimRef::new(half, 0), geom_prim));
                        self.all.has_split_primitives = true;
                    }
                }
            }
            primitive_data => {
                if let Some(one) = prim_ref(&primitive_data) {
                    self.all.push(one, geom_prim);
                }
            }
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
    /// Collects the primitives with their boxes.
    pub(super) fn with_boxes(geometries: &[Geometry], count: usize) -> Self {
        let PrimRefCollector { all, swept_area, .. } = PrimRefCollector::collect(geometries, count, false);
        if swept_area > 0.0 {
            let least = MIN_SPLIT_GAIN * (all.boxes.len() as f64).sqrt() * all.around().surface();
            if MAX_SAVED * swept_area >= least {
                let mut saved = SavedArea(0.0);
                geometries.iter().for_each(|geometry| geometry.data.visit_primitives(&mut saved));
                if saved.0 > 0.0 && saved.0 >= least {
                    return PrimRefCollector::collect(geometries, 2 * count, true).all;
                }
            }
        }
        all
    }

    /// Collects the primitives without their boxes, and the box around all.
    fn without_boxes(geometries: &[Geometry], count: usize) -> Self {
        let mut collector = IdCollector {
            geometry: 0,
            geom_prims: Vec::with_capacity(count),
            around: BoundsCollector(PrimRef::EMPTY),
        };
        for (number, geometry) in geometries.iter().enumerate() {
            collector.geometry = number as u32;
            geometry.data.visit_primitives(&mut collector);
        }
        Self {
            geom_prims: collector.geom_prims,
            bounds: Some(collector.around.0.bounds()),
            ..Self::default()
        }
    }

    #[inline(always)]
    fn push(&mut self, one: PrimRef, geom_prim: GeomPrim) {
        self.boxes.push(one.with_number(self.boxes.len() as u32));
        self.geom_prims.push(geom_prim);
    }

    /// The box around all primitives.
    fn around(&self) -> Bounds {
        self.boxes.iter().fold(PrimRef::EMPTY, |all, one| all.union(one)).bounds()
    }

    /// Discards the boxes, so that no BVH is built.
    fn clear_boxes(&mut self) {
        self.bounds = Some(self.around());
        self.boxes.clear();
    }
}

impl PrimitiveBlocks {
    /// Stores the primitives in the given order; [`GeomPrim::NONE`] is padding.
    pub(super) fn of(geometries: &[Geometry], geom_prims: &[GeomPrim]) -> Self {
        let data = |geom_prim: &GeomPrim| &geometries[geom_prim.geometry as usize].data;
        match geometries.first().map(|geometry| geometry.data.kind()) {
            Some(GeometryKind::Triangles) | None => {
                Self::Triangles(blocks(geom_prims, block::Triangle4::EMPTY, |block, lane, geom_prim| {
                    let GeometryData::Triangles { vertices, indices, transform } = data(geom_prim) else {
                        mixed_kinds()
                    };
                    block.set(lane, primitive::triangle(vertices, indices, transform, geom_prim.primitive));
                }))
            }
            Some(GeometryKind::Aabbs) => {
                Self::Aabbs(blocks(geom_prims, block::Aabb4::EMPTY, |block, lane, geom_prim| {
                    let GeometryData::Aabbs(boxes) = data(geom_prim) else { mixed_kinds() };
                    let (min, max) = corners(boxes[geom_prim.primitive as usize]);
                    block.set(lane, min, max);
                }))
            }
            Some(GeometryKind::Spheres) => {
                Self::Spheres(blocks(geom_prims, block::Sphere4::EMPTY, |block, lane, geom_prim| {
                    let GeometryData::Spheres { positions, radii, indices } = data(geom_prim) else {
                        mixed_kinds()
                    };
                    let sphere = primitive::sphere(positions, radii, indices, geom_prim.primitive as usize);
                    if let Primitive::Sphere { position, radius } = sphere {
                        block.set(lane, position, radius);
                    }
                }))
            }
            Some(GeometryKind::LinearSweptSpheres) => {
                let ends = blocks(geom_prims, block::LinearSweptSphere4::EMPTY, |block, lane, geom_prim| {
                    let GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, .. } =
                        data(geom_prim)
                    else {
                        mixed_kinds()
                    };
                    let ends = primitive::end_vertices(indices, *indexing, geom_prim.primitive as usize);
                    block.set(lane, ends.map(|end| positions[end]), ends.map(|end| radii[end]));
                });
                let caps = blocks(geom_prims, [[false; 2]; LANES], |caps, lane, geom_prim| {
                    let GeometryData::LinearSweptSpheres { indices, indexing, end_caps, .. } =
                        data(geom_prim)
                    else {
                        mixed_kinds()
                    };
                    let at = geom_prim.primitive as usize;
                    caps[lane] = primitive::caps(indices.as_deref(), *indexing, *end_caps, at);
                });
                Self::LinearSweptSpheres(ends, caps)
            }
        }
    }
}

impl PrimitiveBlocks {
    /// Appends blocks of the same kind.
    pub(super) fn append(&mut self, other: Self) {
        match (self, other) {
            (Self::Triangles(all), Self::Triangles(more)) => all.extend(more),
            (Self::Aabbs(all), Self::Aabbs(more)) => all.extend(more),
            (Self::Spheres(all), Self::Spheres(more)) => all.extend(more),
            (Self::LinearSweptSpheres(all, caps), Self::LinearSweptSpheres(more, more_caps)) => {
                all.extend(more);
                caps.extend(more_caps);
            }
            (Self::MovingTriangles(all), Self::MovingTriangles(more)) => all.extend(more),
            _ => mixed_kinds(),
        }
    }
}

/// Makes blocks of four and sets each lane that holds a primitive.
fn blocks<B: Clone>(geom_prims: &[GeomPrim], empty: B, set: impl Fn(&mut B, usize, &GeomPrim)) -> Vec<B> {
    let mut blocks = Vec::with_capacity(geom_prims.len().div_ceil(LANES));
    for geom_prims in geom_prims.chunks(LANES) {
        let mut block = empty.clone();
        for lane in 0..LANES {
            if let Some(geom_prim) = geom_prims.get(lane).filter(|&&geom_prim| geom_prim != GeomPrim::NONE) {
                set(&mut block, lane, geom_prim);
            }
        }
        blocks.push(block);
    }
    blocks
}

#[cold]
fn mixed_kinds() -> ! {
    unreachable!("bug in anyhit: a BLAS of two kinds of primitive")
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
    let [a, b, c] = vertices.map(|[x, y, z]| F32x4::new([x, y, z, 0.0]));
    // Zero times an infinity or a NaN is a NaN.
    let finite = (a * F32x4::ZERO + b * F32x4::ZERO + c * F32x4::ZERO).cmp_ge(F32x4::ZERO) == 0b1111;
    let (low, high) = (a.relaxed_min(b).relaxed_min(c), a.relaxed_max(b).relaxed_max(c));
    finite.then(|| PrimRef::from_corners([low, F32x4::ZERO - high], 0))
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
        let count = |built: &BuiltBlas| {
            built.geom_prims.iter().filter(|&&geom_prim| geom_prim != GeomPrim::NONE).count()
        };
        // With length l a box has the surface 2 l^2, two halves have half of that, and the box
        // around all at most 6 (10 + 2 l / sqrt 3)^2: a line meets 400 l^2 / 6 (10 + 2 l / sqrt
        // 3)^2 boxes fewer or more. It takes 0.1 sqrt 400.
        let dense = BuiltBlas::build(&[rods(400, 5.0)]);
        assert!(dense.has_split_primitives(), "6.7 fewer");
        assert_eq!(count(&dense), 800);
        // And here at most 400 l^2 / 6 9^2, as all rods begin in more than a cube of nine.
        let sparse = BuiltBlas::build(&[rods(400, 0.6)]);
        assert!(!sparse.has_split_primitives(), "0.3 fewer");
        assert_eq!(count(&sparse), 400);
    }
}
