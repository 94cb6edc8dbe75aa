//! A BVH that grows: a node is divided when the first ray opens it.
//!
//! How references are divided depends on those of the node alone. So a tree that has grown holds
//! the nodes that the whole one would hold, with the same boxes, children and leaves; only their
//! numbers differ, which affect nothing ([`NodeRef`]).

use std::ops::Range;

use rustc_hash::FxHashMap;

use crate::accel::binned_sah::SahCost;
use crate::accel::build_record::BuildRecord;
use crate::accel::build_threads::BuildThreads;
use crate::accel::chunked_partition::record_of_chunks;
use crate::accel::node::{Node, NodeRef};
use crate::accel::prim_ref::PrimRef;
use crate::accel::unit_cube::scale_boxes;
use crate::accel::wide_bvh::{BvhBuilder, MAX_SAH_DEPTH, WideBvh, leaf_range, node_over};
use crate::accel::world_space_ray::WorldSpaceTree;

/// A subtree over at most this many boxes is built as a whole.
const MAX_WHOLE: usize = 64;

/// What the nodes of a BVH that are not divided yet are made of.
#[derive(Debug)]
pub(in crate::accel) struct BvhGrowth {
    prim_refs: Vec<PrimRef>,
    /// By the index of a node that is not divided yet.
    undivided: FxHashMap<usize, Undivided>,
    builder: BvhBuilder,
}

/// A node that is not divided yet.
#[derive(Clone, Debug)]
struct Undivided {
    /// Its references.
    range: Range<usize>,
    record: BuildRecord,
    depth: usize,
}

impl BvhGrowth {
    /// Begins a BVH over boxes, as [`WideBvh::from_prim_refs`] takes them, with an undivided root.
    /// There must be more boxes than fit into a leaf.
    pub(in crate::accel) fn begin(mut prim_refs: Vec<PrimRef>, cost: SahCost) -> (WideBvh, Self) {
        assert!(prim_refs.len() > cost.max_leaf_size, "bug in anyhit: a BVH of {} grows", prim_refs.len());
        let (bounds, scale) = scale_boxes(&mut prim_refs, BuildThreads::One);
        let root = NodeRef::inner(0);
        let world_space = WorldSpaceTree::new(scale);
        let bvh =
            WideBvh { nodes: vec![Node::EMPTY], leaves: vec![0], root, depth: 1, bounds, scale, world_space };
        let record = record_of_chunks(&prim_refs, BuildThreads::One);
        let all = Undivided { range: 0..prim_refs.len(), record, depth: 0 };
        let undivided = FxHashMap::from_iter([(root.index(), all)]);
        let builder = BvhBuilder::new(cost, MAX_SAH_DEPTH, BuildThreads::One);
        (bvh, Self { prim_refs, undivided, builder })
    }

    /// The nodes that a ray opens below the given ones and that are not divided yet.
    /// `hit_children` returns a mask of the children of a node that the ray may hit.
    pub(in crate::accel) fn undivided(
        &self,
        bvh: &WideBvh,
        mut open: Vec<NodeRef>,
        hit_children: &mut dyn FnMut(&Node) -> u32,
    ) -> Vec<NodeRef> {
        let mut found = Vec::new();
        while let Some(child) = open.pop() {
            if child.is_leaf() {
                continue;
            }
            if self.undivided.contains_key(&child.index()) {
                found.push(child);
                continue;
            }
            let node = bvh.node(child);
            let hit = hit_children(node);
            open.extend((0..node.count()).filter(|slot| hit >> slot & 1 != 0).map(|slot| node.child(slot)));
        }
        found
    }

    /// The numbers of the boxes in leaves, in tree order and with padding. It grows at its end.
    pub(in crate::accel) fn order(&self) -> &[u32] {
        &self.builder.tree.order
    }

    /// Divides nodes.
    pub(in crate::accel) fn divide(&mut self, bvh: &mut WideBvh, nodes: &[NodeRef]) {
        std::mem::swap(&mut self.builder.tree.nodes, &mut bvh.nodes);
        for node in nodes {
            if let Some(undivided) = self.undivided.remove(&node.index()) {
                self.divide_node(node.index(), undivided);
                bvh.leaves[node.index()] = leaf_range(&self.builder.tree.nodes[node.index()]);
            }
        }
        self.builder.pad_order();
        bvh.leaves.extend(self.builder.tree.nodes[bvh.leaves.len()..].iter().map(leaf_range));
        bvh.depth = self.builder.tree.depth;
        std::mem::swap(&mut self.builder.tree.nodes, &mut bvh.nodes);
    }

    /// Divides one node: makes its leaves and small subtrees, and undivided nodes of the others.
    fn divide_node(&mut self, index: usize, Undivided { range, record, depth }: Undivided) {
        let Self { prim_refs, undivided, builder } = self;
        let mut first = range.start;
        let prim_refs = &mut prim_refs[range];
        builder.tree.depth = builder.tree.depth.max(depth + 1);
        let children = builder.divide(prim_refs, &record, depth);
        builder.tree.nodes[index] = node_over(&children);
        let (mut rest, depth) = (prim_refs, depth + 1);
        for (slot, record) in children.iter().copied().enumerate() {
            let (these, others) = rest.split_at_mut(record.count());
            let range = first..first + these.len();
            first = range.end;
            rest = others;
            let child = if record.is_leaf {
                builder.make_leaf(these)
            } else if these.len() <= MAX_WHOLE {
                builder.build_subtree(these, &record, depth)
            } else {
                let child = NodeRef::inner(builder.tree.nodes.len());
                builder.tree.nodes.push(Node::EMPTY);
                builder.tree.depth = builder.tree.depth.max(depth + 1);
                undivided.insert(child.index(), Undivided { range, record, depth });
                child
            };
            builder.tree.nodes[index].set_child(slot, child);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::wide_bvh::PADDING;
    use crate::geometry::Bounds;
    use crate::math::random::Random;

    const COST: SahCost = SahCost { max_leaf_size: 4, traversal: 1.0, intersection: 0.5, split_below: 1.0 };

    /// Small boxes at random places of the unit cube.
    fn boxes(count: u32) -> Vec<PrimRef> {
        let mut random = Random::new(7);
        let mut one = |number| {
            let min = [random.unit(), random.unit(), random.unit()];
            PrimRef::new(&Bounds { min, max: min.map(|x| x + 0.01) }, number)
        };
        (0..count).map(&mut one).collect()
    }

    /// Everything below a child: boxes of nodes with their children, and the boxes in leaves.
    fn describe(bvh: &WideBvh, order: &[u32], child: NodeRef) -> String {
        if child.is_leaf() {
            let first = child.index() * COST.max_leaf_size;
            return format!("{:?}", &order[first..first + child.count() as usize]);
        }
        let below = |(child, corners)| format!("{corners:?} {}", describe(bvh, order, child));
        let below: Vec<String> = bvh.node(child).children().map(below).collect();
        format!("({})", below.join(", "))
    }

    /// Grows a tree until nothing that is hit is left undivided.
    fn grow(growth: &mut BvhGrowth, bvh: &mut WideBvh, mut hit: impl FnMut(&Node) -> u32) {
        let mut open = vec![bvh.root()];
        loop {
            open = growth.undivided(bvh, open, &mut hit);
            if open.is_empty() {
                return;
            }
            growth.divide(bvh, &open);
        }
    }

    /// Whether the references of each node's children ascend by count and slot.
    fn check_ranks(bvh: &WideBvh, child: NodeRef) {
        if child.is_leaf() {
            return;
        }
        let children: Vec<NodeRef> = bvh.node(child).children().map(|(child, _)| child).collect();
        let mut ranked: Vec<(u32, usize)> = children.iter().map(|one| one.count()).zip(0..).collect();
        ranked.sort_unstable();
        let mut sorted = children.clone();
        sorted.sort_by_key(|one| one.bits());
        assert_eq!(sorted, ranked.iter().map(|&(_, slot)| children[slot]).collect::<Vec<_>>());
        children.iter().for_each(|&child| check_ranks(bvh, child));
    }

    #[test]
    fn a_grown_tree_is_the_whole_tree_however_it_grows() {
        let (whole, whole_order) =
            WideBvh::from_prim_refs(boxes(20_000), COST, BuildThreads::One).expect("not empty");
        let wanted = describe(&whole, &whole_order, whole.root());
        check_ranks(&whole, whole.root());
        for seed in 0..3 {
            let (mut bvh, mut growth) = BvhGrowth::begin(boxes(20_000), COST);
            assert_eq!((bvh.bounds(), bvh.scale()), (whole.bounds(), whole.scale()));
            let mut random = Random::new(seed);
            // Rays that hit some children, then one that hits all.
            for _ in 0..20 {
                grow(&mut growth, &mut bvh, |_| random.bits() as u32);
            }
            grow(&mut growth, &mut bvh, |_| u32::MAX);
            assert!(growth.undivided.is_empty());
            check_ranks(&bvh, bvh.root());
            assert_eq!(describe(&bvh, growth.order(), bvh.root()), wanted, "{seed}");
            assert_eq!(bvh.depth(), whole.depth());
        }
    }

    #[test]
    fn only_what_is_hit_is_divided() {
        let (mut bvh, mut growth) = BvhGrowth::begin(boxes(20_000), COST);
        // One path from the root down: of each node the first child.
        grow(&mut growth, &mut bvh, |_| 1);
        let (nodes, leaves) = (bvh.nodes.len(), growth.order().len());
        // About an eighth of the boxes lie below the first child of the root.
        let boxes = growth.order().iter().filter(|&&number| number != PADDING).count();
        assert!((1..2_500).contains(&boxes), "{boxes} boxes are in leaves");
        grow(&mut growth, &mut bvh, |_| 1);
        assert_eq!((bvh.nodes.len(), growth.order().len()), (nodes, leaves), "the same ray again");
    }
}
