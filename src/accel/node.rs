//! The nodes of a tree and the test of a ray against them (its derivation: `node_ray`).

use crate::accel::node_ray::{NodeLimit, Slabs};
use crate::math::ahead::fetch;
use crate::math::eight::Eights;

/// How many children a node has at most: the lanes of a vector register (AVX) or of two (SSE, NEON).
pub const WIDTH: usize = 8;

/// A child: an inner node, or a leaf of primitives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Child(u32);

/// The bits of a child that say how many primitives it has.
const COUNT_BITS: u32 = 3;

impl Child {
    /// An inner node.
    pub fn inner(node: usize) -> Self {
        Self::of(node, 0)
    }

    /// A leaf of up to 7 primitives. Leaves stand in tree order at multiples of the tree's leaf size;
    /// `index` counts in those.
    pub fn leaf(index: usize, count: usize) -> Self {
        assert!((1..1 << COUNT_BITS).contains(&count), "bug in anyhit: a leaf of {count} primitives");
        Self::of(index, count)
    }

    fn of(index: usize, count: usize) -> Self {
        assert!(index < 1 << (u32::BITS - COUNT_BITS), "bug in anyhit: a BVH of too many nodes");
        Self((index << COUNT_BITS | count) as u32)
    }

    /// As a number.
    #[inline(always)]
    pub fn bits(self) -> u32 {
        self.0
    }

    /// What [`Child::bits`] gave.
    #[inline(always)]
    pub fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Which node, or which leaf.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 >> COUNT_BITS) as usize
    }

    /// How many primitives; 0 for an inner node.
    #[inline(always)]
    pub fn count(self) -> u32 {
        self.0 & ((1 << COUNT_BITS) - 1)
    }

    #[inline(always)]
    pub fn is_leaf(self) -> bool {
        self.count() != 0
    }

    /// The same where nodes and leaves stand so many further on.
    pub fn moved(self, nodes: usize, leaves: usize) -> Self {
        let by = if self.is_leaf() { leaves } else { nodes };
        Self::of(self.index() + by, self.count() as usize)
    }

    /// As many primitives, each as a leaf of one, in a tree whose leaf size is 1.
    pub fn singles(self) -> impl DoubleEndedIterator<Item = Self> {
        (0..self.count() as usize).map(move |at| Self::leaf(self.index() + at, 1))
    }
}

/// An inner node: the boxes of its children side by side (structure of arrays), in scaled units. Four
/// cache lines.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Node {
    /// Per axis the lower planes, then the upper ones.
    planes: [[[f32; WIDTH]; 2]; 3],
    children: [Child; WIDTH],
    /// A bit for each slot that has a child.
    filled: u32,
}

impl Node {
    /// A node over up to `WIDTH` children with their boxes (scaled, minimum and maximum).
    pub fn new(children: &[(Child, [[f32; 3]; 2])]) -> Self {
        debug_assert!((1..=WIDTH).contains(&children.len()));
        let mut node = Self {
            planes: [[[0.0; WIDTH]; 2]; 3],
            children: [Child::default(); WIDTH],
            filled: (1 << children.len()) - 1,
        };
        for (slot, (child, corners)) in children.iter().enumerate() {
            node.children[slot] = *child;
            for (axis, planes) in node.planes.iter_mut().enumerate() {
                planes[0][slot] = corners[0][axis];
                planes[1][slot] = corners[1][axis];
            }
        }
        node
    }

    /// Names the child in a slot.
    pub fn set_child(&mut self, slot: usize, child: Child) {
        self.children[slot] = child;
    }

    /// Adapts the children where nodes and leaves stand so many further on.
    pub fn move_children(&mut self, nodes: usize, leaves: usize) {
        for slot in 0..self.filled.count_ones() as usize {
            self.children[slot] = self.children[slot].moved(nodes, leaves);
        }
    }

    /// How many children there are.
    pub fn count(&self) -> usize {
        self.filled.count_ones() as usize
    }

    /// The children with their boxes (scaled).
    #[cfg(test)]
    pub fn children(&self) -> impl Iterator<Item = (Child, [[f32; 3]; 2])> + '_ {
        (0..self.filled.count_ones() as usize).map(|slot| {
            let corner = |side: usize| std::array::from_fn(|axis| self.planes[axis][side][slot]);
            (self.children[slot], [corner(0), corner(1)])
        })
    }

    /// Where the ray enters each child's box: a lower bound of the rounded t (in the ray's units, see
    /// [`NodeRay::absolute`](super::node_ray::NodeRay::absolute)) of any hit in it, and a bit for each
    /// child that it does not surely miss before `limit`.
    #[inline(always)]
    pub fn entries<E: Eights>(&self, ray: &Slabs<E>, limit: NodeLimit) -> ([f32; WIDTH], u32) {
        let eights = ray.eights;
        let mut near = ray.near_floor;
        let mut far = eights.splat(limit.0);
        for axis in 0..3 {
            let side = ray.near_side[axis] & 1;
            let planes = |side: usize| eights.load(&self.planes[axis][side]);
            let enter = eights.sub(planes(side), ray.near_origin[axis]);
            let leave = eights.sub(planes(side ^ 1), ray.far_origin[axis]);
            near = eights.if_above(eights.mul(enter, ray.near_reciprocal[axis]), near);
            far = eights.if_below(eights.mul(leave, ray.far_reciprocal[axis]), far);
        }
        let met = eights.at_least(far, near);
        (eights.lanes(near), met & self.filled)
    }

    /// Has the processor bring it into its caches.
    #[inline(always)]
    pub fn fetch(&self) {
        self.planes.iter().for_each(|planes| fetch(planes.as_flattened()));
        fetch(&self.children);
    }

    /// A plane of the box of the child in a slot: of an axis the lower (0) or the upper one (1).
    #[inline(always)]
    pub fn plane(&self, axis: usize, side: usize, slot: usize) -> f32 {
        self.planes[axis][side][slot % WIDTH]
    }

    /// The child in a slot.
    #[inline(always)]
    pub fn child(&self, slot: usize) -> Child {
        self.children[slot % WIDTH]
    }
}
