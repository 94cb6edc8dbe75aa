//! Builds a [`BuiltBlas`]: collects the active primitives of the geometries (`collect`), builds the
//! BVH over their boxes if it pays, and stores the primitives in its order.

use crate::accel::binned_sah::SahCost;
use crate::accel::build_threads::BuildThreads;
use crate::accel::built_blas::collect::{self, CollectedPrimitives, active_primitives, corners};
use crate::accel::built_blas::{BuiltBlas, PrimitiveBlocks};
use crate::accel::flags::GeometryFlags;
use crate::accel::geometry::{Geometry, moves, primitive_count};
use crate::accel::geometry_data::{GeometryData, GeometryKind};
use crate::accel::primitive::{self, Primitive};
use crate::accel::primitive_numbers::{GeomPrim, PrimitiveNumbers};
use crate::accel::wide_bvh::{PADDING, WideBvh};
use crate::geometry::Bounds;
use crate::geometry::block::{self, LANES};
use crate::math::array;

/// Up to this many primitives are tested without a BVH: the test of a node costs about as much as
/// that of a primitive.
const MAX_WITHOUT_BVH: usize = 4;

/// SAH costs in units of one node test: of primitives that are tested one by one, of blocks that
/// are tested at once (triangles, spheres), and of blocks most of which are culled (swept spheres).
/// Blocks are filled unless splitting gains much, as they take the same memory however full they
/// are.
const COST_OF_SINGLE_TESTS: SahCost =
    SahCost { max_leaf_size: LANES, traversal: 1.0, intersection: 3.0, split_below: 1.0 };
const COST_OF_BLOCK_TESTS: SahCost = SahCost { intersection: 0.05, split_below: 0.8, ..COST_OF_SINGLE_TESTS };
const COST_OF_SWEPT_SPHERES: SahCost =
    SahCost { traversal: 1.5, intersection: 0.2, split_below: 0.8, ..COST_OF_SINGLE_TESTS };

/// The costs of the tree over geometries.
pub(super) fn cost_of(geometries: &[Geometry]) -> SahCost {
    match geometries.first().map(|geometry| geometry.data.kind()) {
        Some(GeometryKind::Aabbs) => COST_OF_SINGLE_TESTS,
        Some(GeometryKind::LinearSweptSpheres) => COST_OF_SWEPT_SPHERES,
        _ if moves(geometries) => COST_OF_SINGLE_TESTS,
        Some(GeometryKind::Triangles | GeometryKind::Spheres) | None => COST_OF_BLOCK_TESTS,
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
        let count = primitive_count(geometries);
        if count <= MAX_WITHOUT_BVH {
            return Self::without_bvh(geometries);
        }
        BuildThreads::build(count, |threads| Self::with_bvh(geometries, threads))
    }

    /// Collects the active primitives without building a BVH, however many there are.
    pub(crate) fn without_bvh(geometries: &[Geometry]) -> Self {
        let numbers = PrimitiveNumbers::new(geometries);
        let (order, bounds) = active_primitives(geometries, &numbers);
        let blocks = |threads| PrimitiveBlocks::of(geometries, &numbers, &order, threads);
        Self {
            blocks: BuildThreads::build(order.len(), blocks),
            order,
            numbers,
            has_split_primitives: false,
            bvh: None,
            bounds,
            common_flags: common_flags(geometries),
        }
    }

    /// Builds the BVH over the active primitives, if there are any, and stores them in its order.
    fn with_bvh(geometries: &[Geometry], threads: BuildThreads) -> Self {
        let numbers = PrimitiveNumbers::new(geometries);
        let CollectedPrimitives { boxes, has_split_primitives } =
            CollectedPrimitives::new(geometries, &numbers, threads);
        let (mut bvh, order) = WideBvh::from_prim_refs(boxes, cost_of(geometries), threads).unzip();
        let order = order.unwrap_or_default();
        let blocks = PrimitiveBlocks::of(geometries, &numbers, &order, threads);
        if let (PrimitiveBlocks::Triangles(_), Some(bvh)) = (&blocks, &mut bvh) {
            bvh.find_leaves_to_prefetch(threads);
        }
        Self {
            blocks,
            order,
            numbers,
            has_split_primitives,
            bounds: bvh.as_ref().map_or(Bounds::EMPTY, |bvh| *bvh.bounds()),
            bvh,
            common_flags: common_flags(geometries),
        }
    }

    /// The box around all active primitives, none of which moves, computed without building
    /// anything.
    pub(crate) fn bounds_of(geometries: &[Geometry]) -> Bounds {
        collect::bounds_of(geometries)
    }
}

/// Which primitives blocks are made of.
struct BlockOrder<'a> {
    numbers: &'a PrimitiveNumbers,
    order: &'a [u32],
    threads: BuildThreads,
}

impl BlockOrder<'_> {
    /// Makes blocks of four and sets each lane that holds a primitive.
    #[inline(always)]
    fn blocks<B: Copy + Send + Sync>(
        &self,
        empty: impl Fn() -> B + Send + Sync,
        set: impl Fn(&mut B, usize, GeomPrim) + Send + Sync,
    ) -> Vec<B> {
        self.threads.collect(self.order.len().div_ceil(LANES), |at| {
            let mut block = empty();
            for (lane, &number) in self.order[at * LANES..].iter().take(LANES).enumerate() {
                if number != PADDING {
                    set(&mut block, lane, self.numbers.geom_prim(number));
                }
            }
            block
        })
    }
}

impl PrimitiveBlocks {
    /// Stores the primitives in the given order of their numbers; [`PADDING`] is none.
    pub(super) fn of(
        geometries: &[Geometry],
        numbers: &PrimitiveNumbers,
        order: &[u32],
        threads: BuildThreads,
    ) -> Self {
        let order = BlockOrder { numbers, order, threads };
        let data = |geom_prim: GeomPrim| &geometries[geom_prim.geometry as usize].data;
        match geometries.first().map(|geometry| geometry.data.kind()) {
            _ if moves(geometries) => {
                let keys = |GeomPrim { geometry, primitive }| geometries[geometry as usize].keys(primitive);
                let fours = order.blocks(|| [None; LANES], |keys_of, lane, one| keys_of[lane] = keys(one));
                Self::MovingTriangles(fours.into_flattened())
            }
            Some(GeometryKind::Triangles) | None => Self::Triangles(order.blocks(
                || block::Triangle4::EMPTY,
                |block, lane, geom_prim| {
                    let GeometryData::Triangles { vertices, indices, transform } = data(geom_prim) else {
                        mixed_kinds()
                    };
                    block.set(lane, primitive::triangle(vertices, indices, transform, geom_prim.primitive));
                },
            )),
            Some(GeometryKind::Aabbs) => Self::Aabbs(order.blocks(
                || block::Aabb4::EMPTY,
                |block, lane, geom_prim| {
                    let GeometryData::Aabbs(boxes) = data(geom_prim) else { mixed_kinds() };
                    let (min, max) = corners(boxes[geom_prim.primitive as usize]);
                    block.set(lane, min, max);
                },
            )),
            Some(GeometryKind::Spheres) => Self::Spheres(order.blocks(
                || block::Sphere4::EMPTY,
                |block, lane, geom_prim| {
                    let GeometryData::Spheres { positions, radii, indices } = data(geom_prim) else {
                        mixed_kinds()
                    };
                    let sphere = primitive::sphere(positions, radii, indices, geom_prim.primitive as usize);
                    if let Primitive::Sphere { position, radius } = sphere {
                        block.set(lane, position, radius);
                    }
                },
            )),
            Some(GeometryKind::LinearSweptSpheres) => {
                let ends = order.blocks(
                    || block::LinearSweptSphere4::EMPTY,
                    |block, lane, geom_prim| {
                        let GeometryData::LinearSweptSpheres { positions, radii, indices, indexing, .. } =
                            data(geom_prim)
                        else {
                            mixed_kinds()
                        };
                        let ends = primitive::end_vertices(indices, *indexing, geom_prim.primitive as usize);
                        block.set(
                            lane,
                            array::map(ends, |end| positions[end]),
                            array::map(ends, |end| radii[end]),
                        );
                    },
                );
                let caps = order.blocks(
                    || [[false; 2]; LANES],
                    |caps, lane, geom_prim| {
                        let GeometryData::LinearSweptSpheres { indices, indexing, end_caps, .. } =
                            data(geom_prim)
                        else {
                            mixed_kinds()
                        };
                        let at = geom_prim.primitive as usize;
                        caps[lane] = primitive::caps(indices.as_deref(), *indexing, *end_caps, at);
                    },
                );
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

#[cold]
fn mixed_kinds() -> ! {
    unreachable!("bug in anyhit: a BLAS of two kinds of primitive")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::geometry_data::{EndCaps, Indexing};

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
        let count = |built: &BuiltBlas| built.order.iter().filter(|&&number| number != PADDING).count();
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

    /// The numbers of nodes and of leaves.
    fn nodes_and_leaves(built: &BuiltBlas) -> (usize, usize) {
        let bvh = built.bvh().expect("a tree");
        let (mut nodes, mut leaves, mut open) = (0, 0, vec![bvh.root()]);
        while let Some(child) = open.pop() {
            if child.is_leaf() {
                leaves += 1;
            } else {
                nodes += 1;
                open.extend(bvh.node(child).children().map(|(child, _)| child));
            }
        }
        (nodes, leaves)
    }

    #[test]
    fn a_tree_takes_the_room_of_its_nodes_and_blocks() {
        // A node has eight boxes of 24 bytes, as many references of 4, a mask, and fills four
        // cache lines. A leaf has a block, and four numbers of 4 bytes. Swept spheres have two
        // caps each; with nodes of triangles a number stands that is read before them.
        let count = 2000;
        let unit = |at: u32, by: f32| (at as f32 * by).fract();
        let point = |at: u32| [unit(at, 0.819_172_5), unit(at, 0.671_043_6), unit(at, 0.549_700_5)];
        let positions: Vec<[f32; 3]> = (0..count).map(point).collect();
        let corners = |at: u32| [0, 1, 2].map(|axis| point(at).map(|x| x + 0.01 * axis as f32));
        let triangles = GeometryData::Triangles {
            vertices: (0..count).flat_map(corners).collect(),
            indices: None,
            transform: None,
        };
        let radii = vec![0.01; count as usize];
        let spheres = GeometryData::Spheres { positions, radii, indices: None };
        let (blocks_of_triangles, blocks_of_spheres, blocks_of_ends) = (36 * 4, 16 * 4, 32 * 4);
        for (geometry, node, leaf) in [
            (Geometry::new(triangles, GeometryFlags::OPAQUE), 256 + 4, blocks_of_triangles + 16),
            (Geometry::new(spheres, GeometryFlags::OPAQUE), 256, blocks_of_spheres + 16),
            (rods(count, 0.1), 256, blocks_of_ends + 4 * 2 + 16),
        ] {
            let built = BuiltBlas::build(&[geometry]);
            let (nodes, leaves) = nodes_and_leaves(&built);
            assert_eq!(built.memory_size(), nodes * node + leaves * leaf, "{nodes} nodes, {leaves} leaves");
        }
    }
}
