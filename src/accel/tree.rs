//! A tree over boxes: wide nodes, built from the root down by the surface area heuristic.
//!
//! Boxes are brought into the unit cube by a power of two: f32 areas overflow or vanish where
//! coordinates lie near 1e19 or 1e-19. Every box of a node is the union of given ones; how they are
//! divided (`split`) changes time alone.

use std::sync::Mutex;

use smallvec::SmallVec;

use crate::accel::node::{Child, Node, WIDTH};
use crate::accel::node_ray::{round_down, round_up};
use crate::accel::split::{Bins, Extent, FAR, LeafCost, Part, Reference};
use crate::geometry::Bounds;
use crate::math::four::Four;

/// Below this many levels boxes are halved, whatever lies there: nothing else bounds the depth. Trees
/// over scenes stay far above it.
const DEEPEST: usize = 32;

/// What stands in tree order behind a leaf that is not full.
pub const EMPTY_PLACE: u32 = u32::MAX;

/// A subtree over more boxes is built by several threads.
const MANY: usize = 16_384;

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
    /// number. Leaves start at multiples of the leaf size; the places between are [`EMPTY_PLACE`].
    /// Boxes must hold no NaN and have min <= max; sides may be infinite. `None` for no boxes.
    pub fn build(boxes: &[Bounds], cost: LeafCost) -> Option<(Self, Vec<u32>)> {
        Self::build_within(boxes, cost, DEEPEST)
    }

    fn build_within(boxes: &[Bounds], cost: LeafCost, deepest: usize) -> Option<(Self, Vec<u32>)> {
        if boxes.is_empty() {
            return None;
        }
        let bounds = boxes.iter().fold(Bounds::EMPTY, |all, one| all.union(one));
        let scale = scale_of(boxes, &bounds);
        let mut references: Vec<Reference> =
            boxes.iter().enumerate().map(|(number, one)| scaled(one, scale, number as u32)).collect();
        let whole = Part::around(&references);
        let mut build =
            Build { alone: false, cost, deepest, nodes: Vec::new(), order: Vec::new(), bins: Bins::new() };
        let root = build.subtree(&mut references, whole, 0);
        Some((Self { nodes: build.nodes, root, bounds, scale }, build.order))
    }

    /// The inner node that a child names.
    #[inline(always)]
    pub fn node(&self, child: Child) -> &Node {
        &self.nodes[child.index()]
    }

    /// The root: a node or, in a tree of one leaf, that leaf.
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

/// The power of two that brings every finite coordinate of boxes into the unit cube.
fn scale_of(boxes: &[Bounds], around: &Bounds) -> f64 {
    let sides = |one: &Bounds| {
        let sides = one.min.iter().chain(&one.max).map(|x| x.abs());
        sides.filter(|x| x.is_finite()).fold(0.0f32, f32::max)
    };
    let finite = around.min.iter().chain(&around.max).all(|x| x.is_finite());
    let largest = if finite { sides(around) } else { boxes.iter().map(sides).fold(0.0, f32::max) };
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

/// A box in scaled units, rounded outwards; infinite sides lie at ±[`FAR`].
#[inline]
fn scaled(bounds: &Bounds, scale: f64, number: u32) -> Reference {
    let factor = scale as f32;
    let mut out = Reference { low: bounds.min, number, high: bounds.max };
    let mut exact = factor.is_normal();
    for axis in 0..3 {
        for x in [&mut out.low[axis], &mut out.high[axis]] {
            *x *= factor;
            // Unless it meets the subnormal numbers.
            exact &= (x.abs() >= f32::MIN_POSITIVE) & (x.abs() <= 1.0);
        }
    }
    if exact {
        return out;
    }
    let inside = |x: f32| if x.is_finite() { x } else { FAR.copysign(x) };
    let low = bounds.min.map(|x| inside(round_down(f64::from(x) * scale)));
    let high = bounds.max.map(|x| inside(round_up(f64::from(x) * scale)));
    Reference { low, number, high }
}

/// The parts of a node, and which of them are leaves.
type Parts = SmallVec<[(Part, bool); WIDTH]>;

/// A tree in the making.
struct Build {
    /// Whether it may ask for threads.
    alone: bool,
    cost: LeafCost,
    deepest: usize,
    nodes: Vec<Node>,
    order: Vec<u32>,
    bins: Bins,
}

impl Build {
    /// Makes the nodes of a part, which is the given references.
    fn subtree(&mut self, references: &mut [Reference], part: Part, depth: usize) -> Child {
        if self.is_leaf(references, &part) {
            return self.leaf(references);
        }
        let parts = self.divide(references, part, depth);
        let place = self.nodes.len();
        let boxes = parts.iter().map(|(part, _)| (Child::default(), corners(&part.extent)));
        self.nodes.push(Node::new(&boxes.collect::<SmallVec<[_; WIDTH]>>()));
        let mut rest = references;
        let mut slices = SmallVec::<[_; WIDTH]>::new();
        for (part, _) in &parts {
            let (these, others) = rest.split_at_mut(part.count);
            slices.push(these);
            rest = others;
        }
        if !self.alone && part.count > MANY && rayon::current_num_threads() > 1 {
            self.in_threads(place, &parts, slices, depth);
            return Child::inner(place);
        }
        for (slot, ((part, is_leaf), these)) in parts.into_iter().zip(slices).enumerate() {
            let child = if is_leaf { self.leaf(these) } else { self.subtree(these, part, depth + 1) };
            self.nodes[place].set_child(slot, child);
        }
        Child::inner(place)
    }

    /// Divides a part into up to `WIDTH`, in the order of the references, and says which of them are
    /// leaves.
    fn divide(&mut self, references: &mut [Reference], part: Part, depth: usize) -> Parts {
        let halve = depth >= self.deepest;
        let mut parts = Parts::new();
        parts.push((part, false));
        while parts.len() < WIDTH {
            // The largest of those that are no leaf; then of those that may be one.
            let area = |at: usize| parts[at].0.extent.half_area();
            let largest = |must: bool| {
                (0..parts.len())
                    .filter(|&at| !parts[at].1 && (parts[at].0.count > self.cost.most) == must)
                    .max_by(|&a, &b| area(a).total_cmp(&area(b)))
            };
            let Some(at) = largest(true).or_else(|| largest(false)) else { break };
            let (whole, _) = parts[at];
            if whole.count == 1 {
                parts[at].1 = true;
                continue;
            }
            let first: usize = parts[..at].iter().map(|(part, _)| part.count).sum();
            let these = &mut references[first..first + whole.count];
            let [left, right] = self.bins.split(these, &whole, &self.cost, halve);
            let may_stay = whole.count <= self.cost.most;
            if may_stay {
                let cost = |part: &Part| part.extent.half_area() * self.cost.of(part.count);
                if cost(&left) + cost(&right) >= cost(&whole) {
                    parts[at].1 = true;
                    continue;
                }
            }
            parts[at] = (left, false);
            parts.insert(at + 1, (right, false));
        }
        let mut rest = &*references;
        for (part, is_leaf) in &mut parts {
            let (these, others) = rest.split_at(part.count);
            *is_leaf = *is_leaf || self.is_leaf(these, part);
            rest = others;
        }
        parts
    }

    /// Whether a leaf costs a ray less than a node over leaves of one.
    fn is_leaf(&self, references: &[Reference], part: &Part) -> bool {
        let count = part.count;
        let single = || references.iter().map(Reference::half_area).sum::<f32>() * self.cost.of(1);
        let area = part.extent.half_area();
        count <= self.cost.most && (count == 1 || area + single() >= area * self.cost.of(count))
    }

    /// Gives a leaf's boxes their places, from the next multiple of the leaf size on.
    fn leaf(&mut self, references: &[Reference]) -> Child {
        let size = self.cost.most;
        self.order.resize(self.order.len().next_multiple_of(size), EMPTY_PLACE);
        let index = self.order.len() / size;
        self.order.extend(references.iter().map(|reference| reference.number));
        Child::leaf(index, references.len())
    }

    /// Makes the subtrees of a node by several threads: the same nodes in the same order as by one.
    ///
    /// By threads of their own, not by tasks of the pool: a thread of the pool that waits here would
    /// take up other work, and that may wait for this very tree.
    fn in_threads(
        &mut self,
        place: usize,
        parts: &[(Part, bool)],
        slices: SmallVec<[&mut [Reference]; WIDTH]>,
        depth: usize,
    ) {
        let (cost, deepest) = (self.cost, self.deepest);
        let count = parts.len();
        let jobs = Mutex::new(parts.iter().zip(slices).enumerate());
        let done = Mutex::new((0..count).map(|_| None).collect::<Vec<Option<(Self, Child)>>>());
        let work = || {
            loop {
                let job = jobs.lock().expect("bug in anyhit: a thread that builds has panicked").next();
                let Some((slot, ((part, is_leaf), these))) = job else { return };
                let mut own = Self {
                    alone: true,
                    cost,
                    deepest,
                    nodes: Vec::new(),
                    order: Vec::new(),
                    bins: Bins::new(),
                };
                let child = if *is_leaf { own.leaf(these) } else { own.subtree(these, *part, depth + 1) };
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
            self.nodes[place].set_child(slot, child);
        }
    }

    /// Takes over what another thread has made, and says what its root is here.
    fn append(&mut self, own: Self, root: Child) -> Child {
        let size = self.cost.most;
        self.order.resize(self.order.len().next_multiple_of(size), EMPTY_PLACE);
        let (nodes, leaves) = (self.nodes.len(), self.order.len() / size);
        self.order.extend(own.order);
        self.nodes.extend(own.nodes.into_iter().map(|mut node| {
            node.move_children(nodes, leaves);
            node
        }));
        root.moved(nodes, leaves)
    }
}

/// The corners of a part as a node keeps them: with infinite sides.
fn corners(extent: &Extent) -> [[f32; 3]; 2] {
    let infinite = |x: f32| if x.abs() >= FAR { f32::INFINITY.copysign(x) } else { x };
    let three = |corner: Four| {
        let [x, y, z, _] = corner.to_array();
        [infinite(x), infinite(y), infinite(z)]
    };
    [three(extent.low), three(extent.high)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOURS: LeafCost = LeafCost { most: 4, visit: 1.0, primitive: 0.5 };

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
            if !child.is_leaf() {
                open.extend(tree.node(child).children().map(|(child, _)| (child, depth + 1)));
            }
        }
        deepest
    }

    /// Every box stands in exactly one leaf and lies within each node on the way to it.
    fn check(tree: &Tree, order: &[u32], boxes: &[Bounds]) {
        let leaf_size = 4;
        let mut seen = vec![0u32; boxes.len()];
        let mut open = vec![(tree.root(), Vec::<[[f32; 3]; 2]>::new())];
        while let Some((child, around)) = open.pop() {
            if !child.is_leaf() {
                for (child, corners) in tree.node(child).children() {
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
            let (tree, order) = Tree::build(&boxes, FOURS).expect("not empty");
            check(&tree, &order, &boxes);
            // 20,000 boxes in leaves of at most 4 need 5 levels of eight children at least.
            assert!((5..40).contains(&depth(&tree)), "depth {} at {size:e}", depth(&tree));
        }
    }

    #[test]
    fn several_threads_build_what_one_builds() {
        let boxes = boxes(3 * MANY, 1.0);
        let (tree, order) = Tree::build(&boxes, FOURS).expect("not empty");
        check(&tree, &order, &boxes);
        let references =
            boxes.iter().enumerate().map(|(number, one)| scaled(one, tree.scale(), number as u32));
        let mut references: Vec<_> = references.collect();
        let whole = Part::around(&references);
        let (nodes, order_alone) = (Vec::new(), Vec::new());
        let mut alone = Build {
            alone: true,
            cost: FOURS,
            deepest: DEEPEST,
            nodes,
            order: order_alone,
            bins: Bins::new(),
        };
        assert_eq!(alone.subtree(&mut references, whole, 0), tree.root());
        assert_eq!(alone.order, order);
        assert_eq!(format!("{:?}", alone.nodes), format!("{:?}", tree.nodes));
    }

    #[test]
    fn boxes_at_all_scales_make_a_flat_tree() {
        // Each half as large and half as far from the origin as the one before.
        let at = |k: usize| Bounds {
            min: [0.75, 0.5, -1.0].map(|x| x * 0.5f32.powi(k as i32)),
            max: [1.0f32, 0.75, -0.5].map(|x| x * 0.5f32.powi(k as i32)),
        };
        let boxes: Vec<_> = (0..2000).map(|k| at(k % 149)).collect();
        let (tree, order) = Tree::build(&boxes, FOURS).expect("not empty");
        check(&tree, &order, &boxes);
        assert!(depth(&tree) < 40, "{}", depth(&tree));
    }

    #[test]
    fn a_tree_that_is_too_deep_is_balanced_below() {
        let boxes = boxes(5_000, 1.0);
        let (tree, order) = Tree::build_within(&boxes, FOURS, 2).expect("not empty");
        check(&tree, &order, &boxes);
        // Two levels of clustering, then quarters of at most 5,000 down to 4: six levels at most.
        assert!(depth(&tree) <= 8, "{}", depth(&tree));
    }

    #[test]
    fn equal_and_infinite_boxes_make_a_tree_too() {
        let mut many = vec![Bounds { min: [1.0; 3], max: [1.0; 3] }; 20_000];
        many.push(Bounds { min: [f32::NEG_INFINITY, 0.0, 0.0], max: [0.0, f32::INFINITY, 0.0] });
        let (tree, order) = Tree::build(&many, FOURS).expect("not empty");
        check(&tree, &order, &many);
        assert!(depth(&tree) < 40, "{}", depth(&tree));
        let one = [Bounds { min: [0.0; 3], max: [0.0; 3] }];
        let (tree, order) = Tree::build(&one, FOURS).expect("not empty");
        check(&tree, &order, &one);
        assert!(Tree::build(&[], FOURS).is_none());
    }
}
