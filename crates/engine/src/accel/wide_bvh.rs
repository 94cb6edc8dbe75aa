//! A wide BVH: nodes of up to eight children, built from the root down by the surface area
//! heuristic (SAH).
//!
//! Boxes are scaled into the unit cube by a power of two, as f32 areas would overflow or underflow
//! for coordinates near 1e19 or 1e-19. Every box of a node is the union of given boxes; how they
//! are divided (`binned_sah`) affects only time.

pub(super) mod growth;
mod parts;

use std::ops::Range;

use smallvec::SmallVec;

use crate::accel::binned_sah::{BinnedSahBuilder, Children, SahCost};
use crate::accel::build_record::BuildRecord;
use crate::accel::build_threads::BuildThreads;
use crate::accel::chunked_partition::record_of_chunks;
use crate::accel::geometry_data::bytes_of;
use crate::accel::node::{Node, NodeRef, WIDTH};
use crate::accel::prim_ref::{INFINITY_PROXY, PrimRef};
use crate::accel::unit_cube::scale_boxes;
use crate::accel::wide_bvh::parts::{PartLists, build_parts, is_one_part};
use crate::accel::world_space_ray::WorldSpaceTree;
use crate::geometry::Bounds;
use crate::math::array;
use crate::math::lane_ops::{CpuTier, LaneOps, LaneTask};
use crate::math::prefetch::prefetch;

/// From this depth on sets are split at the median, as nothing else bounds the depth. The trees of
/// real scenes are far shallower.
const MAX_SAH_DEPTH: usize = 32;

/// The padding in tree order behind a leaf that is not full.
pub(super) const PADDING: u32 = u32::MAX;

/// A bounding volume hierarchy over numbered boxes, with nodes of up to [`WIDTH`] children.
#[derive(Clone, Debug)]
pub(super) struct WideBvh {
    nodes: Vec<Node>,
    /// For each node the leaves that are worth prefetching: the index of the first times
    /// [`LEAF_RANGE_RADIX`], plus their number. Empty where none is prefetched.
    leaves: Vec<u32>,
    root: NodeRef,
    depth: usize,
    bounds: Bounds,
    scale: f64,
    world_space: WorldSpaceTree,
}

/// The factor by which a range of leaves is packed into one number: the index of the first leaf
/// times this, plus the number of leaves. It is greater than the number of leaves of a node.
const LEAF_RANGE_RADIX: usize = 2 * WIDTH;

/// The leaves of a node are prefetched if a ray reaches this many of them on average.
const MIN_LEAVES_REACHED: f32 = 0.8;

impl WideBvh {
    /// Builds a BVH over boxes that are numbered in their order.
    #[cfg(test)]
    pub(super) fn build(boxes: &[Bounds], cost: SahCost) -> Option<(Self, Vec<u32>)> {
        Self::from_prim_refs(numbered(boxes), cost, BuildThreads::One)
    }

    /// Builds a BVH; returns with it the numbers of the boxes in tree order. Leaves start at
    /// multiples of the leaf size; [`PADDING`] fills those that are shorter. Boxes must hold no NaN
    /// and have min <= max; sides may be infinite. `None` for no boxes.
    pub(super) fn from_prim_refs(
        boxes: Vec<PrimRef>,
        cost: SahCost,
        threads: BuildThreads,
    ) -> Option<(Self, Vec<u32>)> {
        Self::build_with_depth(boxes, cost, MAX_SAH_DEPTH, threads)
    }

    fn build_with_depth(
        mut prim_refs: Vec<PrimRef>,
        cost: SahCost,
        max_sah_depth: usize,
        threads: BuildThreads,
    ) -> Option<(Self, Vec<u32>)> {
        if prim_refs.is_empty() {
            return None;
        }
        let (bounds, scale) = scale_boxes(&mut prim_refs, threads);
        let whole = record_of_chunks(&prim_refs, threads);
        let lists = PartLists::new(cost, max_sah_depth, threads);
        let Subtree { root, nodes, order, depth } = if is_one_part(&prim_refs, threads) {
            lists.whole(&mut prim_refs, &whole)
        } else {
            let parts = build_parts(&mut prim_refs, &whole, 0, &lists);
            threads.drop_while(prim_refs, || lists.join(&parts))
        };
        let world_space = WorldSpaceTree::new(scale);
        Some((Self { nodes, leaves: Vec::new(), root, depth, bounds, scale, world_space }, order))
    }

    /// Finds for each node which leaves are worth prefetching.
    pub(super) fn find_leaves_to_prefetch(&mut self, threads: BuildThreads) {
        self.leaves = threads.collect(self.nodes.len(), |node| leaf_range(&self.nodes[node]));
    }

    /// The inner node that a reference refers to.
    #[inline(always)]
    pub(super) fn node(&self, child: NodeRef) -> &Node {
        &self.nodes[child.index()]
    }

    /// Prefetches an inner node.
    #[inline(always)]
    pub(super) fn prefetch(&self, node: NodeRef) {
        prefetch(&self.nodes, node.index());
    }

    /// [`Node::shrink_box`] of the root.
    #[cfg(any(test, feature = "test-support"))]
    pub(super) fn shrink_box(&mut self, slot: usize) {
        self.nodes[0].shrink_box(slot);
    }

    /// The leaves among a node's children that are worth prefetching, which
    /// [`Self::find_leaves_to_prefetch`] has found; does not load the node.
    #[inline(always)]
    pub(super) fn leaves_to_prefetch(&self, node: NodeRef) -> Range<usize> {
        let leaf_range = self.leaves[node.index()] as usize;
        leaf_range / LEAF_RANGE_RADIX..leaf_range / LEAF_RANGE_RADIX + leaf_range % LEAF_RANGE_RADIX
    }

    /// The root: a node, or a leaf if the tree has only one.
    pub(super) fn root(&self) -> NodeRef {
        self.root
    }

    /// The bytes that it takes.
    pub(super) fn memory_size(&self) -> usize {
        bytes_of(&self.nodes) + bytes_of(&self.leaves)
    }

    /// The number of inner nodes.
    #[inline(always)]
    pub(super) fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// The number of nodes on the longest path from the root to a leaf.
    pub(super) fn depth(&self) -> usize {
        self.depth
    }

    /// The box around all primitives, not scaled.
    pub(super) fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The power of two by which the boxes of the nodes are scaled.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// Which rays in world space it takes in f32.
    #[inline(always)]
    pub(super) fn world_space(&self) -> &WorldSpaceTree {
        &self.world_space
    }
}

/// The leaves among a node's children, packed as in [`WideBvh::leaves_to_prefetch`]; none if they
/// are not contiguous, or if a ray that hits the node reaches too few of them, by the ratio of
/// surface areas.
fn leaf_range(node: &Node) -> u32 {
    let half_area = |[min, max]: [[f32; 3]; 2]| {
        let [x, y, z] = [max[0] - min[0], max[1] - min[1], max[2] - min[2]];
        x * y + y * z + z * x
    };
    let (mut around, mut reached) = ([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], 0.0);
    let (mut first, mut end, mut count) = (usize::MAX, 0, 0);
    for slot in 0..node.count() {
        let corners = array::map([0, 1], |side| array::map([0, 1, 2], |axis| node.plane(axis, side, slot)));
        for axis in 0..3 {
            around[0][axis] = around[0][axis].min(corners[0][axis]);
            around[1][axis] = around[1][axis].max(corners[1][axis]);
        }
        let child = node.child(slot);
        if child.is_leaf() {
            reached += half_area(corners);
            (first, end) = (first.min(child.index()), end.max(child.index() + 1));
            count += 1;
        }
    }
    if count == 0 || end - first != count || reached < MIN_LEAVES_REACHED * half_area(around) {
        return 0;
    }
    u32::try_from(first * LEAF_RANGE_RADIX + count).unwrap_or(0)
}

#[cfg(test)]
fn numbered(boxes: &[Bounds]) -> Vec<PrimRef> {
    boxes.iter().enumerate().map(|(number, one)| PrimRef::new(one, number as u32)).collect()
}

/// A part of a tree in depth-first order. References count from its first node and its first leaf.
#[derive(Debug, Default)]
struct Subtree {
    root: NodeRef,
    nodes: Vec<Node>,
    /// The numbers of the boxes in leaves, in tree order and with padding.
    order: Vec<u32>,
    /// The number of nodes on the longest path from the root of the whole tree.
    depth: usize,
}

/// A BVH while it is built.
#[derive(Debug)]
struct BvhBuilder {
    threads: BuildThreads,
    cost: SahCost,
    max_sah_depth: usize,
    tree: Subtree,
    builder: BinnedSahBuilder,
    cpu_tier: CpuTier,
}

/// The arguments of [`BinnedSahBuilder::divide`], as a task.
struct Divide<'a> {
    builder: &'a mut BinnedSahBuilder,
    prim_refs: &'a mut [PrimRef],
    whole: &'a BuildRecord,
    cost: &'a SahCost,
    median_split: bool,
    threads: BuildThreads,
}

impl LaneTask for Divide<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: LaneOps>(self, simd: V) {
        let Self { builder, prim_refs, whole, cost, median_split, threads } = self;
        builder.divide(simd, prim_refs, whole, cost, median_split, threads);
    }
}

impl BvhBuilder {
    fn new(cost: SahCost, max_sah_depth: usize, threads: BuildThreads) -> Self {
        assert!(cost.max_leaf_size.is_power_of_two(), "bug in anyhit: leaves of {}", cost.max_leaf_size);
        Self {
            threads,
            cost,
            max_sah_depth,
            tree: Subtree::default(),
            builder: BinnedSahBuilder::new(),
            cpu_tier: CpuTier::new(),
        }
    }

    /// Builds the subtree over references, those of a record.
    fn build_subtree(&mut self, prim_refs: &mut [PrimRef], whole: &BuildRecord, depth: usize) -> NodeRef {
        if prim_refs.len() == 1 {
            return self.make_leaf(prim_refs);
        }
        let children = self.divide(prim_refs, whole, depth);
        if let [BuildRecord { is_leaf: true, .. }] = children[..] {
            return self.make_leaf(prim_refs);
        }
        let node_index = self.tree.nodes.len();
        self.tree.depth = self.tree.depth.max(depth + 1);
        self.tree.nodes.push(node_over(&children));
        let mut rest = prim_refs;
        for (slot, record) in children.iter().enumerate() {
            let (these, others) = rest.split_at_mut(record.count());
            let child = if record.is_leaf {
                self.make_leaf(these)
            } else {
                self.build_subtree(these, record, depth + 1)
            };
            self.tree.nodes[node_index].set_child(slot, child);
            rest = others;
        }
        NodeRef::inner(node_index)
    }

    /// [`Self::build_subtree`] of an empty tree.
    fn build_small_subtree(
        &mut self,
        prim_refs: &mut [PrimRef],
        whole: &BuildRecord,
        depth: usize,
    ) -> NodeRef {
        // Usually enough.
        self.tree.nodes.reserve(prim_refs.len() / 4);
        self.tree.order.reserve(prim_refs.len() + prim_refs.len() / 4);
        self.build_subtree(prim_refs, whole, depth)
    }

    /// Divides references, those of a record, among the children of a node.
    fn divide(&mut self, prim_refs: &mut [PrimRef], whole: &BuildRecord, depth: usize) -> Children {
        let median_split = depth >= self.max_sah_depth;
        let Self { builder, cost, threads, .. } = self;
        let divide = Divide { builder, prim_refs, whole, cost, median_split, threads: *threads };
        self.cpu_tier.run(divide);
        self.builder.children()
    }

    /// Makes a leaf: appends its references to the order from the next multiple of the leaf size
    /// on.
    fn make_leaf(&mut self, prim_refs: &[PrimRef]) -> NodeRef {
        self.pad_order();
        let order = &mut self.tree.order;
        let index = order.len() >> self.cost.max_leaf_size.trailing_zeros();
        order.extend(prim_refs.iter().map(PrimRef::number));
        NodeRef::leaf(index, prim_refs.len())
    }

    /// Pads the order, so that the next leaf begins at its end.
    fn pad_order(&mut self) {
        // A power of two.
        let last = self.cost.max_leaf_size - 1;
        let order = &mut self.tree.order;
        order.resize((order.len() + last) & !last, PADDING);
    }
}

/// The node over children whose references are not set yet.
#[inline]
fn node_over(children: &[BuildRecord]) -> Node {
    let boxes = children.iter().map(|record| (NodeRef::default(), corners(record)));
    Node::new(&boxes.collect::<SmallVec<[_; WIDTH]>>())
}

/// The corners of a record as a node stores them, with infinite sides.
#[inline]
fn corners(record: &BuildRecord) -> [[f32; 3]; 2] {
    let infinite = |x: f32| if x.abs() >= INFINITY_PROXY { f32::INFINITY.copysign(x) } else { x };
    let Bounds { min, max } = record.bounds();
    [array::map(min, infinite), array::map(max, infinite)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::build_threads::PARALLEL_BUILD_MIN;
    use crate::math::random::Random;

    const FOURS: SahCost = SahCost { max_leaf_size: 4, traversal: 1.0, intersection: 0.5, split_below: 1.0 };

    /// Small boxes at random places of a cube, from a multiplicative generator.
    fn boxes(count: usize, size: f32) -> Vec<Bounds> {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        (0..count)
            .map(|_| {
                let min = [next(), next(), next()].map(|x| x * size);
                Bounds { min, max: min.map(|x| x + 0.001 * size) }
            })
            .collect()
    }

    fn build(boxes: &[Bounds]) -> (WideBvh, Vec<u32>) {
        WideBvh::build(boxes, FOURS).expect("not empty")
    }

    /// The number of nodes on the longest path from the root to a leaf.
    fn depth(bvh: &WideBvh) -> usize {
        let mut deepest = 0;
        let mut open = vec![(bvh.root(), 0)];
        while let Some((child, depth)) = open.pop() {
            deepest = deepest.max(depth);
            if !child.is_leaf() {
                open.extend(bvh.node(child).children().map(|(child, _)| (child, depth + 1)));
            }
        }
        deepest
    }

    /// Every box lies in exactly one leaf, and within each node on the path to it.
    fn check(bvh: &WideBvh, order: &[u32], boxes: &[Bounds]) {
        let leaf_size = 4;
        let mut seen = vec![0u32; boxes.len()];
        let mut open = vec![(bvh.root(), Vec::<[[f32; 3]; 2]>::new())];
        while let Some((child, around)) = open.pop() {
            if !child.is_leaf() {
                for (child, corners) in bvh.node(child).children() {
                    let mut around = around.clone();
                    around.push(corners);
                    open.push((child, around));
                }
                continue;
            }
            let first = child.index() * leaf_size;
            for &number in &order[first..first + child.count() as usize] {
                let number = number as usize;
                seen[number] += 1;
                for corners in &around {
                    let below = |a: f32, b: f32, scale: f64| f64::from(a) <= f64::from(b) * scale;
                    let Bounds { min, max } = boxes[number];
                    assert!(corners[0].iter().zip(min).all(|(&side, x)| below(side, x, bvh.scale())));
                    assert!(corners[1].iter().zip(max).all(|(&side, x)| below(-side, -x, bvh.scale())));
                }
            }
        }
        assert!(seen.iter().all(|&count| count == 1));
    }

    #[test]
    fn every_box_is_found_at_any_scale_and_the_tree_stays_flat() {
        for size in [1.0, 1e30, 1e-30, 1e38, 1e-41] {
            let boxes = boxes(20_000, size);
            let (bvh, order) = build(&boxes);
            check(&bvh, &order, &boxes);
            // 20,000 boxes in leaves of at most 4 need 5 levels of eight children at least.
            assert!((5..40).contains(&depth(&bvh)), "depth {} at {size:e}", depth(&bvh));
            assert_eq!(bvh.depth(), depth(&bvh));
        }
    }

    /// Unit squares side by side, `across` in a row, and as many again at the distance `away` along
    /// the first axis.
    fn squares(across: usize, away: f32) -> Vec<Bounds> {
        let at = |k: usize, x: f32| [x + (k % across) as f32, (k / across) as f32, 0.0];
        let square = |min: [f32; 3]| Bounds { min, max: [min[0] + 1.0, min[1] + 1.0, 0.0] };
        [0.0, away].iter().flat_map(|&x| (0..4).map(move |k| square(at(k, x)))).collect()
    }

    /// The number of boxes in each leaf of a tree of one node.
    fn leaves_of_root(bvh: &WideBvh) -> Vec<u32> {
        bvh.node(bvh.root()).children().map(|(child, _)| child.count()).collect()
    }

    #[test]
    fn a_leaf_is_divided_where_enough_of_its_cost_goes() {
        // Halves of a flat patch have half its surface each: two leaves of two cost 2 (1 + 2/16) of
        // 2 (1 + 4/16), which is 0.9 of one leaf of four; two leaves of one 17/18 of that.
        let cost =
            |split_below| SahCost { max_leaf_size: 4, traversal: 1.0, intersection: 0.0625, split_below };
        for (divided, wanted) in [(1.0, vec![1; 8]), (0.92, vec![2; 4]), (0.8, vec![4; 2])] {
            let (bvh, _) = WideBvh::build(&squares(2, 64.0), cost(divided)).expect("not empty");
            assert_eq!(leaves_of_root(&bvh), wanted, "{divided}");
        }
    }

    #[test]
    fn leaves_are_prefetched_where_a_ray_reaches_them() {
        let cost = SahCost { split_below: 0.8, intersection: 0.0625, ..FOURS };
        // The leaves have 8 units of surface; the box around both has 8, then 12.
        for (away, wanted) in [(2.0, 0..2), (4.0, 0..0)] {
            let (mut bvh, _) = WideBvh::build(&squares(2, away), cost).expect("not empty");
            bvh.find_leaves_to_prefetch(BuildThreads::One);
            assert_eq!(leaves_of_root(&bvh), [4; 2]);
            assert_eq!(bvh.leaves_to_prefetch(bvh.root()), wanted, "{away}");
        }
        // For every node in a large tree they are its own leaves, or none.
        let boxes = boxes(20_000, 1.0);
        let (mut bvh, _) = build(&boxes);
        bvh.find_leaves_to_prefetch(BuildThreads::One);
        let mut open = vec![bvh.root()];
        while let Some(node) = open.pop() {
            let (leaves, inner): (Vec<_>, Vec<_>) =
                bvh.node(node).children().map(|(child, _)| child).partition(|child| child.is_leaf());
            let leaf_range = bvh.leaves_to_prefetch(node);
            assert!(leaf_range.is_empty() || leaf_range.eq(leaves.iter().map(|leaf| leaf.index())));
            open.extend(inner);
        }
    }

    #[test]
    fn several_threads_build_what_one_builds() {
        let mut random = Random::new(3);
        // Scattered, on a grid with many ties, all at one place, and some without end.
        let mut many: [Vec<Bounds>; 4] = std::array::from_fn(|_| boxes(6 * PARALLEL_BUILD_MIN, 1.0));
        for one in &mut many[1] {
            let min = one.min.map(|x| (x * 9.0).floor() - 4.0);
            *one = Bounds { min: min.map(|x| if random.below(2) == 0 { x } else { -x }), max: [9.0; 3] };
        }
        many[2].fill(Bounds { min: [1.0; 3], max: [1.0; 3] });
        for one in many[3].iter_mut().step_by(1000) {
            one.max[random.below(3) as usize] = f32::INFINITY;
        }
        for boxes in &many {
            let (whole, order) = build(boxes);
            check(&whole, &order, boxes);
            for count in [1, 2, 5] {
                let (bvh, same) = BuildThreads::build_in_pool(count, |threads| {
                    let tree = WideBvh::from_prim_refs(numbered(boxes), FOURS, threads);
                    let (mut bvh, order) = tree.expect("not empty");
                    bvh.find_leaves_to_prefetch(threads);
                    (bvh, order)
                });
                assert_eq!(same, order);
                assert_eq!((bvh.root, bvh.depth, bvh.bounds), (whole.root, whole.depth, whole.bounds));
                assert_eq!(format!("{:?}", bvh.nodes), format!("{:?}", whole.nodes));
                assert_eq!(bvh.leaves, whole.nodes.iter().map(leaf_range).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn boxes_at_all_scales_make_a_flat_tree() {
        // Each half as large and half as far from the origin as the one before.
        let at = |k: usize| Bounds {
            min: [0.75, 0.5, -1.0].map(|x| x * 0.5f32.powi(k as i32)),
            max: [1.0f32, 0.75, -0.5].map(|x| x * 0.5f32.powi(k as i32)),
        };
        let boxes: Vec<_> = (0..2000).map(|k| at(k % 149)).collect();
        let (bvh, order) = build(&boxes);
        check(&bvh, &order, &boxes);
        assert!(depth(&bvh) < 40, "{}", depth(&bvh));
    }

    #[test]
    fn a_tree_that_is_too_deep_is_balanced_below() {
        let boxes = boxes(5_000, 1.0);
        let (bvh, order) =
            WideBvh::build_with_depth(numbered(&boxes), FOURS, 2, BuildThreads::One).expect("not empty");
        check(&bvh, &order, &boxes);
        // Two levels of clustering, then quarters of at most 5,000 down to 4: six levels at most.
        assert!(depth(&bvh) <= 8, "{}", depth(&bvh));
    }

    #[test]
    fn equal_and_infinite_boxes_make_a_tree_too() {
        let mut many = vec![Bounds { min: [1.0; 3], max: [1.0; 3] }; 20_000];
        many.push(Bounds { min: [f32::NEG_INFINITY, 0.0, 0.0], max: [0.0, f32::INFINITY, 0.0] });
        let (bvh, order) = build(&many);
        check(&bvh, &order, &many);
        assert!(depth(&bvh) < 40, "{}", depth(&bvh));
        let one = [Bounds { min: [0.0; 3], max: [0.0; 3] }];
        let (bvh, order) = build(&one);
        check(&bvh, &order, &one);
        assert!(WideBvh::build(&[], FOURS).is_none());
    }
}
