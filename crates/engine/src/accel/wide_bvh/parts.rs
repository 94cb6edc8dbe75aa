//! The parts of a tree that several threads build, and how they are joined.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::accel::binned_sah::SahCost;
use crate::accel::build_record::BuildRecord;
use crate::accel::build_threads::{BuildThreads, PARALLEL_BUILD_MIN};
use crate::accel::node::{Node, NodeRef, WIDTH};
use crate::accel::prim_ref::PrimRef;
use crate::accel::wide_bvh::{BvhBuilder, Subtree, node_over};
use anyhit_base::sorted::sort_by_key;

/// Builds the tree over references, those of a record, as parts that follow one another in
/// depth-first order. Several threads make a part of each subtree that is small enough, and of each
/// node above.
pub(super) fn build_parts(
    prim_refs: &mut [PrimRef],
    whole: &BuildRecord,
    depth: usize,
    lists: &PartLists,
) -> Vec<Part> {
    if is_one_part(prim_refs, lists.threads) {
        return vec![lists.add(|builder| builder.build_small_subtree(prim_refs, whole, depth))];
    }
    let records = lists.builder().divide(prim_refs, whole, depth);
    let mut node = node_over(&records);
    let mut rest = prim_refs;
    let mut children = Vec::with_capacity(WIDTH);
    for &record in records.iter() {
        let (these, others) = rest.split_at_mut(record.count());
        children.push((these, record));
        rest = others;
    }
    let children = lists.threads.map(children, |(these, record)| match record.is_leaf {
        false => build_parts(these, &record, depth + 1, lists),
        true => vec![lists.add(|builder| builder.make_leaf(these))],
    });
    let (mut nodes, mut leaves) = (1, 0);
    for (slot, parts) in children.iter().enumerate() {
        node.set_child(slot, parts[0].root.offset_by(nodes, leaves));
        nodes += parts.iter().map(|part| part.nodes.len()).sum::<usize>();
        leaves += parts.iter().map(|part| part.order.len()).sum::<usize>() / lists.cost.max_leaf_size;
    }
    let above = lists.add(|builder| {
        builder.tree.nodes.push(node);
        builder.tree.depth = depth + 1;
        NodeRef::inner(0)
    });
    std::iter::once(above).chain(children.into_iter().flatten()).collect()
}

/// Returns whether a tree over this input is built by one thread.
pub(super) fn is_one_part(prim_refs: &[PrimRef], threads: BuildThreads) -> bool {
    threads == BuildThreads::One || prim_refs.len() <= PARALLEL_BUILD_MIN
}

/// A part of a tree: a [`Subtree`] whose content is in a [`PartList`].
#[derive(Clone, Debug)]
pub(super) struct Part {
    root: NodeRef,
    depth: usize,
    /// The number of its list.
    list: usize,
    nodes: Range<usize>,
    order: Range<usize>,
}

/// The content of parts that one thread after another has built.
#[derive(Debug)]
struct PartList {
    number: usize,
    builder: BvhBuilder,
    nodes: Vec<Node>,
    order: Vec<u32>,
}

/// The lists of all parts, as many as threads: allocators return the memory of few large lists,
/// and keep that of many small ones.
pub(super) struct PartLists {
    cost: SahCost,
    max_sah_depth: usize,
    threads: BuildThreads,
    /// Those that no thread uses, and the number of all.
    idle: Mutex<(Vec<PartList>, usize)>,
}

impl PartLists {
    pub(super) fn new(cost: SahCost, max_sah_depth: usize, threads: BuildThreads) -> Self {
        Self { cost, max_sah_depth, threads, idle: Mutex::default() }
    }

    fn builder(&self) -> BvhBuilder {
        BvhBuilder::new(self.cost, self.max_sah_depth, self.threads)
    }

    fn idle(&self) -> MutexGuard<'_, (Vec<PartList>, usize)> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a part, of which `build` returns the root.
    fn add(&self, build: impl FnOnce(&mut BvhBuilder) -> NodeRef) -> Part {
        let (known, number) = {
            let (lists, count) = &mut *self.idle();
            let known = lists.pop();
            *count += usize::from(known.is_none());
            (known, *count - 1)
        };
        let new = || PartList { number, builder: self.builder(), nodes: Vec::new(), order: Vec::new() };
        let mut list = known.unwrap_or_else(new);
        let root = build(&mut list.builder);
        list.builder.pad_order();
        let Subtree { nodes, order, depth, .. } = &mut list.builder.tree;
        let (first_node, first_in_order) = (list.nodes.len(), list.order.len());
        list.nodes.append(nodes);
        list.order.append(order);
        let part = Part {
            root,
            depth: std::mem::take(depth),
            list: list.number,
            nodes: first_node..list.nodes.len(),
            order: first_in_order..list.order.len(),
        };
        self.idle().0.push(list);
        part
    }

    /// The tree over references, those of a record, as one part.
    pub(super) fn whole(&self, prim_refs: &mut [PrimRef], whole: &BuildRecord) -> Subtree {
        let mut builder = self.builder();
        builder.tree.root = builder.build_small_subtree(prim_refs, whole, 0);
        builder.pad_order();
        builder.tree.nodes.shrink_to_fit();
        builder.tree.order.shrink_to_fit();
        builder.tree
    }

    /// Joins parts that follow one another.
    pub(super) fn join(self, parts: &[Part]) -> Subtree {
        let (threads, leaf_size) = (self.threads, self.cost.max_leaf_size);
        let (mut lists, _) = self.idle.into_inner().unwrap_or_else(PoisonError::into_inner);
        sort_by_key(&mut lists, |list| list.number);
        let (root, depth) = (parts[0].root, parts.iter().map(|part| part.depth).max().unwrap_or(0));
        let mut starts = Vec::with_capacity(parts.len());
        let (mut node_count, mut order_count) = (0, 0);
        for part in parts {
            starts.push((node_count, order_count));
            node_count += part.nodes.len();
            order_count += part.order.len();
        }
        let nodes = threads.collect(node_count, |at| {
            // Parts without nodes start where the next one does.
            let part = starts.partition_point(|&(first_node, _)| first_node <= at) - 1;
            let (first_node, first_in_order) = starts[part];
            let Part { list, nodes, .. } = &parts[part];
            let mut node = lists[*list].nodes[nodes.start + at - first_node];
            node.offset_children(first_node, first_in_order / leaf_size);
            node
        });
        let mut order = vec![0; order_count];
        let mut rest = &mut order[..];
        let mut copies = Vec::with_capacity(parts.len());
        for part in parts {
            let (to, others) = rest.split_at_mut(part.order.len());
            copies.push((to, &lists[part.list].order[part.order.clone()]));
            rest = others;
        }
        threads.map(copies, |(to, from)| to.copy_from_slice(from));
        threads.map(lists, drop);
        Subtree { root, nodes, order, depth }
    }
}
