//! A tree over boxes: built by obvhs as a binary tree, kept as our own wide nodes.
//!
//! obvhs gets the boxes times a power of two that brings them into the unit cube: its f32 areas
//! overflow or vanish where coordinates lie near 1e19 or 1e-19, and its trees degenerate then. Our
//! node boxes are unions of the given boxes, computed here; obvhs only decides what lies together.

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use crate::accel::node::{Child, Node, WIDTH};
use crate::accel::node_ray::{round_down, round_up};
use crate::geometry::Bounds;

/// Below this many levels the clustered tree is not kept but balanced: nothing bounds the depth of
/// clustering. Trees over scenes stay far above it.
const CLUSTERED_DEPTH: usize = 32;

/// What stands in tree order behind a leaf that is not full.
pub const EMPTY_PLACE: u32 = u32::MAX;

/// How many parts a node of a balanced subtree has.
const QUARTERS: usize = 4;

/// A tree over boxes that were given by number.
#[derive(Debug)]
pub struct Tree {
    nodes: Vec<Node>,
    root: Child,
    bounds: Bounds,
    scale: f64,
}

impl Tree {
    /// Builds a tree, and says in which order its leaves name the boxes: place in tree order ->
    /// number. Leaves start at multiples of `leaf_size`; the places between are [`EMPTY_PLACE`]. Boxes must hold no NaN and have min <= max; sides may be infinite. `None` for no
    /// boxes.
    pub fn build(boxes: &[Bounds], leaf_size: u32) -> Option<(Self, Vec<u32>)> {
        Self::build_clustered(boxes, leaf_size, CLUSTERED_DEPTH)
    }

    fn build_clustered(boxes: &[Bounds], leaf_size: u32, depth: usize) -> Option<(Self, Vec<u32>)> {
        if boxes.is_empty() {
            return None;
        }
        let bounds = boxes.iter().fold(Bounds::EMPTY, |all, one| all.union(one));
        let scale = scale_of(boxes);
        let scaled: Vec<Scaled> = boxes.iter().map(|one| Scaled::new(one, scale)).collect();
        let binary = build_binary(&scaled, leaf_size);
        let (nodes, root, order) = widen(&binary, &scaled, leaf_size, depth);
        Some((Self { nodes, root, bounds, scale }, order))
    }

    /// The inner node with an index.
    #[inline]
    pub fn node(&self, index: u32) -> &Node {
        &self.nodes[index as usize]
    }

    /// The root: a node or, in a tree of one leaf, a run of boxes.
    pub fn root(&self) -> Child {
        self.root
    }

    /// The box around all, not scaled.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The power of two by which the boxes of the nodes are scaled.
    pub fn scale(&self) -> f64 {
        self.scale
    }
}

/// The power of two that brings every finite coordinate into the unit cube.
fn scale_of(boxes: &[Bounds]) -> f64 {
    let largest = boxes
        .iter()
        .flat_map(|one| one.min.iter().chain(&one.max))
        .map(|x| x.abs())
        .filter(|x| x.is_finite())
        .fold(0.0f32, f32::max);
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

/// A box in scaled units; infinite sides stay infinite.
#[derive(Clone, Copy)]
struct Scaled {
    corners: [[f32; 3]; 2],
}

impl Scaled {
    const EMPTY: Self = Self { corners: [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]] };

    fn new(bounds: &Bounds, scale: f64) -> Self {
        // Exact in f64; in f32 it can meet the subnormal numbers.
        let low = bounds.min.map(|x| round_down(f64::from(x) * scale));
        let high = bounds.max.map(|x| round_up(f64::from(x) * scale));
        Self { corners: [low, high] }
    }

    fn union(self, other: Self) -> Self {
        let [low, high] = self.corners;
        let [other_low, other_high] = other.corners;
        Self {
            corners: [
                std::array::from_fn(|axis| low[axis].min(other_low[axis])),
                std::array::from_fn(|axis| high[axis].max(other_high[axis])),
            ],
        }
    }

    /// Half the surface; only orders choices.
    fn half_area(&self) -> f32 {
        let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| self.corners[1][axis] - self.corners[0][axis]);
        x * y + y * z + z * x
    }
}

/// A box as obvhs gets it: finite, and a little larger on each side by an amount that differs from
/// box to box.
///
/// Clustering pairs each box with the neighbour that makes the smallest union, and takes quadratic
/// time where all unions are alike: equal boxes, or points on an axis-parallel line.
fn padded(number: usize, scaled: &Scaled) -> Aabb {
    // Six draws of three bits from a multiplicative hash: 4 to 11 times 2^-24, a unit in the last
    // place at the cube's surface.
    let hash = (number as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32;
    let pad = |draw: usize| (4 + (hash >> (3 * draw) & 7)) as f32 / 16_777_216.0;
    // Infinite sides would make NaN centres.
    let finite = |x: f32| x.clamp(-2.0, 2.0);
    let [low, high] = scaled.corners;
    Aabb::new(
        Vec3A::from_array(std::array::from_fn(|axis| finite(low[axis]) - pad(axis))),
        Vec3A::from_array(std::array::from_fn(|axis| finite(high[axis]) + pad(3 + axis))),
    )
}

/// Builds a binary tree: locally ordered clustering, then reinsertion of the worst nodes (the steps
/// of obvhs' fast preset, without its validation in debug builds, which is slower than the build).
fn build_binary(boxes: &[Scaled], leaf_size: u32) -> Bvh2 {
    let numbers: Vec<u32> = (0..boxes.len() as u32).collect();
    let boxes: Vec<Aabb> = boxes.iter().enumerate().map(|(number, one)| padded(number, one)).collect();
    let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Low,
        &boxes,
        numbers,
        SortPrecision::U64,
        2,
    );
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut binary, 0.02, None);
    collapse(&mut binary, leaf_size, 1.0);
    binary
}

/// Makes wide nodes of a binary tree: an inner child gives way to its own two children, the largest
/// first, until there are `WIDTH`.
fn widen(
    binary: &Bvh2,
    boxes: &[Scaled],
    leaf_size: u32,
    clustered_depth: usize,
) -> (Vec<Node>, Child, Vec<u32>) {
    let node_boxes = node_boxes(binary, boxes);
    let is_leaf = |index: usize| binary.nodes[index].prim_count > 0;
    let mut order = Vec::with_capacity(boxes.len());
    let mut nodes: Vec<Node> = Vec::new();
    // A wide node's place is fixed when its parent is made; its content comes when it is popped.
    let leaf = |index: usize, order: &mut Vec<u32>| {
        let node = &binary.nodes[index];
        let run = node.first_index as usize..(node.first_index + node.prim_count) as usize;
        leaf_of(&binary.primitive_indices[run], leaf_size, order)
    };
    if is_leaf(0) {
        let root = leaf(0, &mut order);
        return (nodes, root, order);
    }
    let mut open = vec![(0usize, 0usize, None::<(usize, usize)>)];
    while let Some((index, depth, parent)) = open.pop() {
        if depth >= clustered_depth {
            let mut numbers = numbers_below(binary, index);
            let child = halve(&mut numbers, boxes, leaf_size, &mut nodes, &mut order);
            let (parent, slot) = parent.expect("bug in anyhit: a root below the root");
            nodes[parent].set_child(slot, child);
            continue;
        }
        let first = binary.nodes[index].first_index as usize;
        let mut members = vec![first, first + 1];
        while members.len() < WIDTH {
            let widest = (0..members.len()).filter(|&slot| !is_leaf(members[slot])).max_by(|&a, &b| {
                let area = |slot: usize| node_boxes[members[slot]].half_area();
                area(a).total_cmp(&area(b))
            });
            let Some(slot) = widest else { break };
            let first = binary.nodes[members[slot]].first_index as usize;
            members[slot] = first;
            members.insert(slot + 1, first + 1);
        }
        let place = nodes.len();
        let mut children = [(Child::default(), [[0.0; 3]; 2]); WIDTH];
        for (slot, &member) in members.iter().enumerate() {
            let child = if is_leaf(member) { leaf(member, &mut order) } else { Child::default() };
            children[slot] = (child, node_boxes[member].corners);
        }
        nodes.push(Node::new(&children[..members.len()]));
        if let Some((parent, slot)) = parent {
            nodes[parent].set_child(slot, Child { first: place as u32, count: 0 });
        }
        // The first child is laid out next.
        for (slot, &member) in members.iter().enumerate().rev() {
            if !is_leaf(member) {
                open.push((member, depth + 1, Some((place, slot))));
            }
        }
    }
    (nodes, Child { first: 0, count: 0 }, order)
}

/// Gives a leaf's boxes their places, from the next multiple of the leaf size on.
fn leaf_of(numbers: &[u32], leaf_size: u32, order: &mut Vec<u32>) -> Child {
    order.resize(order.len().next_multiple_of(leaf_size as usize), EMPTY_PLACE);
    let first = order.len() as u32;
    order.extend_from_slice(numbers);
    Child { first, count: numbers.len() as u32 }
}

/// The numbers of all boxes below a node of a binary tree.
fn numbers_below(binary: &Bvh2, index: usize) -> Vec<u32> {
    let mut numbers = Vec::new();
    let mut open = vec![index];
    while let Some(index) = open.pop() {
        let node = &binary.nodes[index];
        let first = node.first_index as usize;
        if node.prim_count == 0 {
            open.extend([first, first + 1]);
        } else {
            numbers.extend_from_slice(&binary.primitive_indices[first..first + node.prim_count as usize]);
        }
    }
    numbers
}

/// A balanced subtree: quarters by the middle along the longest side, whatever lies there.
fn halve(
    numbers: &mut [u32],
    boxes: &[Scaled],
    leaf_size: u32,
    nodes: &mut Vec<Node>,
    order: &mut Vec<u32>,
) -> Child {
    if numbers.len() <= QUARTERS {
        return leaf_of(numbers, leaf_size, order);
    }
    let around = |numbers: &[u32]| {
        numbers.iter().fold(Scaled::EMPTY, |all, &number| all.union(boxes[number as usize]))
    };
    let split = |numbers: &mut [u32]| {
        let [low, high] = around(numbers).corners;
        let side = |axis: usize| high[axis] - low[axis];
        let axis = (0..3).max_by(|&a, &b| side(a).total_cmp(&side(b))).unwrap_or(0);
        let middle = |number: u32| {
            let [low, high] = boxes[number as usize].corners;
            low[axis] * 0.5 + high[axis] * 0.5
        };
        let half = numbers.len() / 2;
        numbers.select_nth_unstable_by(half, |&a, &b| middle(a).total_cmp(&middle(b)));
        half
    };
    let half = split(numbers);
    let (left, right) = numbers.split_at_mut(half);
    let (left_half, right_half) = (split(left), split(right));
    let (a, b) = left.split_at_mut(left_half);
    let (c, d) = right.split_at_mut(right_half);
    let place = nodes.len();
    nodes.push(Node::new(&[&*a, &*b, &*c, &*d].map(|quarter| (Child::default(), around(quarter).corners))));
    for (slot, quarter) in [a, b, c, d].into_iter().enumerate() {
        let child = halve(quarter, boxes, leaf_size, nodes, order);
        nodes[place].set_child(slot, child);
    }
    Child { first: place as u32, count: 0 }
}

/// The box of each node of a binary tree, from its leaves up.
fn node_boxes(binary: &Bvh2, boxes: &[Scaled]) -> Vec<Scaled> {
    let mut out = vec![Scaled::EMPTY; binary.nodes.len()];
    let mut parents_first = vec![0usize];
    let mut at = 0;
    while let Some(&index) = parents_first.get(at) {
        let node = &binary.nodes[index];
        if node.prim_count == 0 {
            parents_first.extend([node.first_index as usize, node.first_index as usize + 1]);
        }
        at += 1;
    }
    for index in parents_first.into_iter().rev() {
        let node = &binary.nodes[index];
        let first = node.first_index as usize;
        out[index] = if node.prim_count == 0 {
            out[first].union(out[first + 1])
        } else {
            binary.primitive_indices[first..first + node.prim_count as usize]
                .iter()
                .fold(Scaled::EMPTY, |all, &number| all.union(boxes[number as usize]))
        };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// The nodes on the longest way from the root to a leaf.
    fn depth(tree: &Tree) -> usize {
        let mut deepest = 0;
        let mut open = vec![(tree.root(), 0)];
        while let Some((child, depth)) = open.pop() {
            deepest = deepest.max(depth);
            if child.count == 0 {
                open.extend(tree.node(child.first).children().map(|(child, _)| (child, depth + 1)));
            }
        }
        deepest
    }

    /// Every box stands in exactly one leaf and lies within each node on the way to it.
    fn check(tree: &Tree, order: &[u32], boxes: &[Bounds]) {
        let mut seen = vec![0u32; boxes.len()];
        let mut open = vec![(tree.root(), Vec::<[[f32; 3]; 2]>::new())];
        while let Some((child, around)) = open.pop() {
            if child.count == 0 {
                for (child, corners) in tree.node(child.first).children() {
                    let mut around = around.clone();
                    around.push(corners);
                    open.push((child, around));
                }
                continue;
            }
            for place in child.first..child.first + child.count {
                let number = order[place as usize] as usize;
                seen[number] += 1;
                for corners in &around {
                    let below = |a: f32, b: f32, scale: f64| f64::from(a) <= f64::from(b) * scale;
                    let Bounds { min, max } = boxes[number];
                    assert!(corners[0].iter().zip(min).all(|(&side, x)| below(side, x, tree.scale())));
                    assert!(corners[1].iter().zip(max).all(|(&side, x)| below(-side, -x, tree.scale())));
                }
            }
        }
        assert!(seen.iter().all(|&count| count == 1));
    }

    #[test]
    fn every_box_is_found_at_any_scale_and_the_tree_stays_flat() {
        for size in [1.0, 1e30, 1e-30, 1e38, 1e-41] {
            let boxes = boxes(20_000, size);
            let (tree, order) = Tree::build(&boxes, 4).expect("not empty");
            check(&tree, &order, &boxes);
            // 20,000 boxes in leaves of at most 4 need 5 levels of eight children at least.
            assert!((5..40).contains(&depth(&tree)), "depth {} at {size:e}", depth(&tree));
        }
    }

    #[test]
    fn a_tree_that_is_too_deep_is_balanced_below() {
        let boxes = boxes(5_000, 1.0);
        let (tree, order) = Tree::build_clustered(&boxes, 4, 2).expect("not empty");
        check(&tree, &order, &boxes);
        // Two levels of clustering, then quarters of at most 5,000 down to 4: six levels at most.
        assert!(depth(&tree) <= 8, "{}", depth(&tree));
    }

    #[test]
    fn equal_and_infinite_boxes_make_a_tree_too() {
        let mut many = vec![Bounds { min: [1.0; 3], max: [1.0; 3] }; 20_000];
        many.push(Bounds { min: [f32::NEG_INFINITY, 0.0, 0.0], max: [0.0, f32::INFINITY, 0.0] });
        let (tree, order) = Tree::build(&many, 4).expect("not empty");
        check(&tree, &order, &many);
        assert!(depth(&tree) < 40, "{}", depth(&tree));
        let one = [Bounds { min: [0.0; 3], max: [0.0; 3] }];
        let (tree, order) = Tree::build(&one, 4).expect("not empty");
        check(&tree, &order, &one);
        assert!(Tree::build(&[], 4).is_none());
    }
}
