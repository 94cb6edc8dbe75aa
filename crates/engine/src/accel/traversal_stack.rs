//! The stack of a traversal: the nodes and leaves that it still has to visit.

use crate::accel::node::{Node, NodeRef, WIDTH};
use crate::accel::trav_ray::{NodeLimit, Slabs, TravRay};
use crate::accel::wide_bvh::WideBvh;
use crate::math::f32x8::F32x8Ops;

/// A node or leaf that is still to be visited. The high half holds the bits of a lower bound of the
/// rounded t of any hit in it, in the units of its tree's ray (it is not negative, so that its bits
/// are ordered like the numbers); the low half holds the [`NodeRef`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct StackEntry(u64);

impl StackEntry {
    #[inline(always)]
    pub(super) fn new(child: NodeRef, t_near: f32) -> Self {
        Self(u64::from(t_near.to_bits()) << 32 | u64::from(child.bits()))
    }

    #[inline(always)]
    pub(super) fn node(self) -> NodeRef {
        NodeRef::from_bits(self.0 as u32)
    }

    #[inline(always)]
    pub(super) fn t_near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }
}

/// The traversal stack.
#[derive(Clone, Debug)]
pub(super) struct Stack {
    /// The first `len` of these are on the stack; the others are room for more.
    slots: Vec<StackEntry>,
    len: usize,
    /// For each entry a lower bound of the rounded t of any hit in it or in an entry below it. Not
    /// maintained if no candidate is possible.
    t_lower_bounds: Vec<f32>,
}

impl Stack {
    /// A stack of no entries.
    pub(super) const EMPTY: Self = Self { slots: Vec::new(), len: 0, t_lower_bounds: Vec::new() };

    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.len
    }

    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.len = 0;
        self.t_lower_bounds.clear();
    }

    #[inline(always)]
    pub(super) fn pop<const FULLY_OPAQUE: bool>(&mut self) -> Option<StackEntry> {
        if !FULLY_OPAQUE {
            self.t_lower_bounds.pop();
        }
        let top = self.len.checked_sub(1)?;
        self.len = top;
        self.slots.get(top).copied()
    }

    /// Pushes an entry; `ray` is the ray of its tree.
    #[inline(always)]
    pub(super) fn push<const FULLY_OPAQUE: bool>(&mut self, entry: StackEntry, ray: &TravRay) {
        self.ensure_room(WIDTH);
        self.slots[self.len] = entry;
        self.len += 1;
        if !FULLY_OPAQUE {
            self.push_t_lower_bound(ray.absolute(entry.t_near()));
        }
    }

    /// Pushes the children of a node that the ray hits but the nearest, which it returns; the
    /// nearest of the others comes to the top.
    #[inline(always)]
    pub(super) fn push_children<E: F32x8Ops, const FULLY_OPAQUE: bool>(
        &mut self,
        limit: NodeLimit,
        node: &Node,
        ray: &TravRay,
        slabs: &Slabs<E>,
    ) -> Option<StackEntry> {
        let bottom = self.len;
        self.ensure_room(WIDTH);
        let (nearest, others) =
            nearest_first(node, slabs, slabs.simd.splat(limit.0), &mut self.slots, bottom)?;
        self.len = bottom + others;
        if !FULLY_OPAQUE {
            for at in bottom..self.len {
                self.push_t_lower_bound(ray.absolute(self.slots[at].t_near()));
            }
        }
        Some(nearest)
    }

    /// The entry on top.
    #[inline(always)]
    pub(super) fn top(&self) -> Option<StackEntry> {
        self.slots.get(self.len.checked_sub(1)?).copied()
    }

    /// The lower bound of all hits that the entries can hold.
    #[inline(always)]
    pub(super) fn t_lower_bound(&self) -> Option<f32> {
        self.t_lower_bounds.last().copied()
    }

    #[inline(always)]
    fn push_t_lower_bound(&mut self, t: f32) {
        let t_lower_bound = self.t_lower_bounds.last().map_or(t, |&below| if below < t { below } else { t });
        self.t_lower_bounds.push(t_lower_bound);
    }

    /// Room above the entries for the traversal of one tree where no candidate is possible.
    #[inline(always)]
    pub(super) fn room_for(&mut self, bvh: &WideBvh) -> TreeStack<'_> {
        // A node leaves all its children but one on the stack.
        self.ensure_room(bvh.depth() * (WIDTH - 1) + WIDTH);
        TreeStack { slots: &mut self.slots[self.len..], len: 0 }
    }

    #[inline(always)]
    fn ensure_room(&mut self, more: usize) {
        if self.slots.len() < self.len + more {
            self.grow(more);
        }
    }

    #[cold]
    #[inline(never)]
    fn grow(&mut self, more: usize) {
        self.slots.resize(2 * (self.len + more), StackEntry::default());
    }
}

/// The stack of the traversal of one tree where no candidate is possible.
pub(super) struct TreeStack<'a> {
    slots: &'a mut [StackEntry],
    len: usize,
}

impl TreeStack<'_> {
    /// Removes all entries.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    /// As [`Stack::push_children`], with the limit in all lanes; returns also whether there are
    /// others.
    #[inline(always)]
    pub(super) fn push_children<E: F32x8Ops>(
        &mut self,
        node: &Node,
        slabs: &Slabs<E>,
        limit: E::F32x8,
    ) -> Option<(NodeRef, Option<NodeRef>)> {
        let (nearest, others) = nearest_first(node, slabs, limit, self.slots, self.len)?;
        self.len += others;
        Some((nearest.node(), if others == 0 { None } else { self.top() }))
    }

    /// Takes the topmost entry that is not behind a limit.
    #[inline(always)]
    pub(super) fn pop(&mut self, limit: NodeLimit) -> Option<NodeRef> {
        loop {
            self.len = self.len.checked_sub(1)?;
            let entry = *self.slots.get(self.len)?;
            if entry.t_near() <= limit.0 {
                return Some(entry.node());
            }
        }
    }

    #[inline(always)]
    fn top(&self) -> Option<NodeRef> {
        self.slots.get(self.len.wrapping_sub(1)).map(|entry| entry.node())
    }
}

/// Finds the children of a node that the ray hits up to a limit (in all lanes). Returns the nearest
/// and the number of the others, which it stores from an index on, the farthest first.
#[inline(always)]
fn nearest_first<E: F32x8Ops>(
    node: &Node,
    slabs: &Slabs<E>,
    limit: E::F32x8,
    slots: &mut [StackEntry],
    bottom: usize,
) -> Option<(StackEntry, usize)> {
    let (near, mut rest) = node.intersect(slabs, limit);
    if rest == 0 {
        return None;
    }
    let first = entry(node, &near, rest);
    rest &= rest - 1;
    if rest == 0 {
        return Some((first, 0));
    }
    // Most rays hit one or two children.
    let second = entry(node, &near, rest);
    rest &= rest - 1;
    let others: &mut [StackEntry; WIDTH] =
        slots[bottom..].first_chunk_mut().expect("bug in anyhit: the stack is full");
    let mut nearest = first.min(second);
    others[0] = first.max(second);
    let mut count = 1;
    while rest != 0 {
        let next = entry(node, &near, rest);
        rest &= rest - 1;
        let other = nearest.max(next);
        nearest = nearest.min(next);
        let mut at = count;
        while at > 0 && others[(at - 1) % WIDTH] < other {
            others[at % WIDTH] = others[(at - 1) % WIDTH];
            at -= 1;
        }
        others[at % WIDTH] = other;
        count += 1;
    }
    Some((nearest, count))
}

/// The entry of the first child in a mask.
#[inline(always)]
fn entry(node: &Node, near: &[f32; WIDTH], children: u32) -> StackEntry {
    let slot = children.trailing_zeros() as usize % WIDTH;
    StackEntry::new(node.child(slot), near[slot])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::world_space_ray::WorldSpaceTree;
    use crate::geometry::Ray;
    use crate::math::baseline_simd::BaselineSimd;

    #[test]
    fn children_are_visited_nearest_first_and_up_to_a_limit() {
        // Boxes across the x axis, entered at these t.
        let boxes = [3.0, 1.0, 4.0, 2.0].map(|x: f32| [[x, -1.0, -1.0], [x + 0.5, 1.0, 1.0]]);
        let leaf = |index: usize| NodeRef::leaf(index, 1);
        let children: Vec<_> = (0..4).map(|index| (leaf(index), boxes[index])).collect();
        let node = Node::new(&children);
        let mut ray = TravRay::EMPTY;
        assert!(ray.set_world_space(&Ray::new([0.0; 3], [1.0, 0.0, 0.0]), &WorldSpaceTree::new(1.0)));
        let slabs = ray.slabs(BaselineSimd);
        let limits = |t: f32| F32x8Ops::splat(BaselineSimd, t);
        let mut slots = [StackEntry::default(); WIDTH];
        let mut stack = TreeStack { slots: &mut slots, len: 0 };

        let pushed = stack.push_children(&node, &slabs, limits(f32::MAX));
        assert_eq!(pushed, Some((leaf(1), Some(leaf(3)))));
        let rest: Vec<_> = std::iter::from_fn(|| stack.pop(NodeLimit(f32::MAX))).collect();
        assert_eq!(rest, [leaf(3), leaf(0), leaf(2)]);

        assert!(stack.push_children(&node, &slabs, limits(f32::MAX)).is_some());
        let rest: Vec<_> = std::iter::from_fn(|| stack.pop(NodeLimit(2.5))).collect();
        assert_eq!(rest, [leaf(3)]);

        assert_eq!(stack.push_children(&node, &slabs, limits(1.5)), Some((leaf(1), None)));
        assert_eq!(stack.push_children(&node, &slabs, limits(0.5)), None);
    }
}
