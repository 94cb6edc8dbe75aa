//! A wide BVH: nodes of up to eight children, built from the root down by the surface area
//! heuristic (SAH).
//!
//! Boxes are scaled into the unit cube by a power of two, as f32 areas would overflow or underflow
//! for coordinates near 1e19 or 1e-19. Every box of a node is the union of given boxes; how they
//! are divided (`binned_sah`) affects only time.

pub(super) mod growth;

use std::ops::Range;
use std::sync::Mutex;

use smallvec::SmallVec;

use crate::accel::binned_sah::{BinnedSahBuilder, BuildRecord, INFINITY_PROXY, PrimRef, SahCost};
use crate::accel::geometry_data::bytes_of;
use crate::accel::node::{Node, NodeRef, WIDTH};
use crate::accel::trav_ray::{round_down, round_up};
use crate::accel::world_space_ray::WorldSpaceTree;
use crate::geometry::Bounds;
use crate::math::f32x4::F32x4;
use crate::math::lane_ops::{CpuTier, LaneOps, LaneTask};
use crate::math::prefetch::prefetch;

/// From this depth on sets are split at the median, as nothing else bounds the depth. The trees of
/// real scenes are far shallower.
const MAX_SAH_DEPTH: usize = 32;

/// The padding in tree order behind a leaf that is not full.
pub(super) const PADDING: u32 = u32::MAX;

/// A subtree over more boxes than this is built by several threads in parallel.
const PARALLEL_BUILD_MIN: usize = 16_384;

/// A bounding volume hierarchy over numbered boxes, with nodes of up to [`WIDTH`] children.
#[derive(Clone, Debug)]
pub(super) struct WideBvh {
    nodes: Vec<Node>,
    /// For each node the leaves that are worth prefetching: the index of the first times
    /// [`LEAF_RANGE_RADIX`], plus their number.
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
        Self::from_prim_refs(numbered(boxes), cost)
    }

    /// Builds a BVH; returns with it the numbers of the boxes in tree order. Leaves start at
    /// multiples of the leaf size; [`PADDING`] fills those that are shorter. Boxes must hold no NaN
    /// and have min <= max; sides may be infinite. `None` for no boxes.
    pub(super) fn from_prim_refs(boxes: Vec<PrimRef>, cost: SahCost) -> Option<(Self, Vec<u32>)> {
        Self::build_with_depth(boxes, cost, MAX_SAH_DEPTH)
    }

    fn build_with_depth(
        mut prim_refs: Vec<PrimRef>,
        cost: SahCost,
        max_sah_depth: usize,
    ) -> Option<(Self, Vec<u32>)> {
        if prim_refs.is_empty() {
            return None;
        }
        let (bounds, scale) = scale_boxes(&mut prim_refs);
        let mut build = BvhBuilder::new(cost, max_sah_depth, false);
        let root = build.build_subtree(&mut prim_refs, 0);
        let leaves = build.nodes.iter().map(leaf_range).collect();
        let BvhBuilder { nodes, order, depth, .. } = build;
        let world_space = WorldSpaceTree::new(scale);
        Some((Self { nodes, leaves, root, depth, bounds, scale, world_space }, order))
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
    #[cfg(all(test, feature = "stress"))]
    pub(super) fn shrink_box(&mut self, slot: usize) {
        self.nodes[0].shrink_box(slot);
    }

    /// The leaves among a node's children that are worth prefetching; does not load the node.
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
        let corners = [0, 1].map(|side| [0, 1, 2].map(|axis| node.plane(axis, side, slot)));
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

/// Scales boxes into the unit cube; returns the box around all as it was, and the scale.
fn scale_boxes(prim_refs: &mut [PrimRef]) -> (Bounds, f64) {
    let bounds = prim_refs.iter().fold(PrimRef::EMPTY, |all, one| all.union(one)).bounds();
    let scale = scale_of(prim_refs, &bounds);
    prim_refs.iter_mut().for_each(|prim_ref| *prim_ref = scaled(prim_ref, scale));
    (bounds, scale)
}

/// The power of two that brings every finite coordinate of boxes into the unit cube.
fn scale_of(boxes: &[PrimRef], around: &Bounds) -> f64 {
    let sides = |one: &Bounds| {
        let sides = one.min.iter().chain(&one.max).map(|x| x.abs());
        sides.filter(|x| x.is_finite()).fold(0.0f32, f32::max)
    };
    let finite = around.min.iter().chain(&around.max).all(|x| x.is_finite());
    let largest =
        if finite { sides(around) } else { boxes.iter().map(|one| sides(&one.bounds())).fold(0.0, f32::max) };
    if largest == 0.0 {
        return 1.0;
    }
    // Between 2^-149 and 2^128, so that its reciprocal is a normal f64.
    let mut power = 1.0f64;
    while power < f64::from(largest) {
        power *= 2.0;
    }
    while power * 0.5 >= f64::from(largest) {
        power *= 0.5;
    }
    1.0 / power
}

/// A box in scaled units, rounded outwards; infinite sides lie at ±[`INFINITY_PROXY`].
#[inline]
fn scaled(prim_ref: &PrimRef, scale: f64) -> PrimRef {
    let factor = scale as f32;
    let corners = [prim_ref.low(), prim_ref.negated_high()];
    let scaled = corners.map(|corner| corner * F32x4::splat(factor));
    // Exact where no number is infinite or subnormal.
    let exact = |corner: F32x4, scaled: F32x4| {
        let normal = scaled.abs().cmp_ge(F32x4::splat(f32::MIN_POSITIVE));
        let zero = F32x4::ZERO.cmp_ge(corner.abs());
        F32x4::splat(1.0).cmp_ge(scaled.abs()) & (normal | zero)
    };
    if factor.is_normal() && exact(corners[0], scaled[0]) & exact(corners[1], scaled[1]) & 0b111 == 0b111 {
        return PrimRef::from_corners(scaled, prim_ref.number());
    }
    let inside = |x: f32| if x.is_finite() { x } else { INFINITY_PROXY.copysign(x) };
    let Bounds { min, max } = prim_ref.bounds();
    let min = min.map(|x| inside(round_down(f64::from(x) * scale)));
    let max = max.map(|x| inside(round_up(f64::from(x) * scale)));
    PrimRef::new(&Bounds { min, max }, prim_ref.number())
}

/// A BVH while it is built.
#[derive(Debug)]
struct BvhBuilder {
    /// Whether one thread builds it, without starting others.
    single_threaded: bool,
    cost: SahCost,
    max_sah_depth: usize,
    nodes: Vec<Node>,
    order: Vec<u32>,
    /// The number of nodes on the longest path from the root of the whole tree so far.
    depth: usize,
    builder: BinnedSahBuilder,
    cpu_tier: CpuTier,
}

/// For each child of a node the number of references, and whether it is a leaf.
type ChildSizes = SmallVec<[(usize, bool); WIDTH]>;

/// The arguments of [`BinnedSahBuilder::divide`], as a task.
struct Divide<'a> {
    builder: &'a mut BinnedSahBuilder,
    prim_refs: &'a mut [PrimRef],
    cost: &'a SahCost,
    median_split: bool,
}

impl LaneTask for Divide<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: LaneOps>(self, simd: V) {
        self.builder.divide(simd, self.prim_refs, self.cost, self.median_split);
    }
}

impl BvhBuilder {
    fn new(cost: SahCost, max_sah_depth: usize, single_threaded: bool) -> Self {
        assert!(cost.max_leaf_size.is_power_of_two(), "bug in anyhit: leaves of {}", cost.max_leaf_size);
        Self {
            single_threaded,
            cost,
            max_sah_depth,
            nodes: Vec::new(),
            order: Vec::new(),
            depth: 0,
            builder: BinnedSahBuilder::new(),
            cpu_tier: CpuTier::new(),
        }
    }

    /// Builds the subtree over references.
    fn build_subtree(&mut self, prim_refs: &mut [PrimRef], depth: usize) -> NodeRef {
        if prim_refs.len() == 1 {
            return self.make_leaf(prim_refs);
        }
        self.divide(prim_refs, depth);
        let records = self.child_sizes();
        if let [(_, true)] = records[..] {
            return self.make_leaf(prim_refs);
        }
        let node_index = self.nodes.len();
        self.depth = self.depth.max(depth + 1);
        self.nodes.push(self.divided_node());
        if !self.single_threaded && prim_refs.len() > PARALLEL_BUILD_MIN && rayon::current_num_threads() > 1 {
            self.build_children_in_parallel(node_index, &records, prim_refs, depth);
            return NodeRef::inner(node_index);
        }
        let mut rest = prim_refs;
        for (slot, (count, is_leaf)) in records.into_iter().enumerate() {
            let (these, others) = rest.split_at_mut(count);
            let child = if is_leaf { self.make_leaf(these) } else { self.build_subtree(these, depth + 1) };
            self.nodes[node_index].set_child(slot, child);
            rest = others;
        }
        NodeRef::inner(node_index)
    }

    /// Divides references among the children of a node.
    fn divide(&mut self, prim_refs: &mut [PrimRef], depth: usize) {
        let median_split = depth >= self.max_sah_depth;
        let divide = Divide { builder: &mut self.builder, prim_refs, cost: &self.cost, median_split };
        self.cpu_tier.run(divide);
    }

    /// The sizes of the children that [`Self::divide`] made last.
    fn child_sizes(&self) -> ChildSizes {
        self.builder.records().map(|record| (record.count(), record.is_leaf())).collect()
    }

    /// The node over the children that [`Self::divide`] made last, whose references are not set.
    fn divided_node(&self) -> Node {
        let boxes = self.builder.records().map(|record| (NodeRef::default(), corners(record)));
        Node::new(&boxes.collect::<SmallVec<[_; WIDTH]>>())
    }

    /// Makes a leaf: appends its references to the order from the next multiple of the leaf size
    /// on.
    fn make_leaf(&mut self, prim_refs: &[PrimRef]) -> NodeRef {
        self.pad_order();
        let index = self.order.len() >> self.cost.max_leaf_size.trailing_zeros();
        self.order.extend(prim_refs.iter().map(PrimRef::number));
        NodeRef::leaf(index, prim_refs.len())
    }

    /// Builds the subtrees of a node by several threads; the nodes and the order are the same as on
    /// one thread.
    ///
    /// It spawns threads instead of using rayon's pool: a thread of the pool that waits here would
    /// steal other work, which may wait for this very tree.
    fn build_children_in_parallel(
        &mut self,
        node_index: usize,
        records: &[(usize, bool)],
        prim_refs: &mut [PrimRef],
        depth: usize,
    ) {
        let (cost, max_sah_depth) = (self.cost, self.max_sah_depth);
        let count = records.len();
        let mut rest = prim_refs;
        let mut slices = SmallVec::<[_; WIDTH]>::new();
        for &(count, is_leaf) in records {
            let (these, others) = rest.split_at_mut(count);
            slices.push((is_leaf, these));
            rest = others;
        }
        let jobs = Mutex::new(slices.into_iter().enumerate());
        let done = Mutex::new((0..count).map(|_| None).collect::<Vec<Option<(Self, NodeRef)>>>());
        let work = || {
            loop {
                let job = jobs.lock().expect("bug in anyhit: a thread that builds has panicked").next();
                let Some((slot, (is_leaf, these))) = job else { return };
                let mut own = Self::new(cost, max_sah_depth, true);
                let child = if is_leaf { own.make_leaf(these) } else { own.build_subtree(these, depth + 1) };
                done.lock().expect("bug in anyhit: a thread that builds has panicked")[slot] =
                    Some((own, child));
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..rayon::current_num_threads().min(count) {
                scope.spawn(work);
            }
            work();
        });
        let done = done.into_inner().expect("bug in anyhit: a thread that builds has panicked");
        for (slot, (own, child)) in done.into_iter().flatten().enumerate() {
            let child = self.append(own, child);
            self.nodes[node_index].set_child(slot, child);
        }
    }

    /// Pads the order, so that the next leaf begins at its end.
    fn pad_order(&mut self) {
        // A power of two.
        let last = self.cost.max_leaf_size - 1;
        self.order.resize((self.order.len() + last) & !last, PADDING);
    }

    /// Appends a subtree that another thread has built; returns its root in this tree.
    fn append(&mut self, own: Self, root: NodeRef) -> NodeRef {
        self.pad_order();
        let (nodes, leaves) = (self.nodes.len(), self.order.len() / self.cost.max_leaf_size);
        self.order.extend(own.order);
        self.depth = self.depth.max(own.depth);
        self.nodes.extend(own.nodes.into_iter().map(|mut node| {
            node.offset_children(nodes, leaves);
            node
        }));
        root.offset_by(nodes, leaves)
    }
}

/// The corners of a record as a node stores them, with infinite sides.
fn corners(record: &BuildRecord) -> [[f32; 3]; 2] {
    let infinite = |x: f32| if x.abs() >= INFINITY_PROXY { f32::INFINITY.copysign(x) } else { x };
    let Bounds { min, max } = record.bounds();
    [min.map(infinite), max.map(infinite)]
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let (bvh, _) = WideBvh::build(&squares(2, away), cost).expect("not empty");
            assert_eq!(leaves_of_root(&bvh), [4; 2]);
            assert_eq!(bvh.leaves_to_prefetch(bvh.root()), wanted, "{away}");
        }
        // For every node in a large tree they are its own leaves, or none.
        let boxes = boxes(20_000, 1.0);
        let (bvh, _) = build(&boxes);
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
        let boxes = boxes(3 * PARALLEL_BUILD_MIN, 1.0);
        let (bvh, order) = build(&boxes);
        check(&bvh, &order, &boxes);
        assert_eq!(bvh.depth(), depth(&bvh));
        let mut prim_refs = numbered(&boxes);
        prim_refs.iter_mut().for_each(|prim_ref| *prim_ref = scaled(prim_ref, bvh.scale()));
        let mut single = BvhBuilder::new(FOURS, MAX_SAH_DEPTH, true);
        assert_eq!(single.build_subtree(&mut prim_refs, 0), bvh.root());
        assert_eq!(single.order, order);
        assert_eq!(format!("{:?}", single.nodes), format!("{:?}", bvh.nodes));
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
        let (bvh, order) = WideBvh::build_with_depth(numbered(&boxes), FOURS, 2).expect("not empty");
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
