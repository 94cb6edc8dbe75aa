//! The inner nodes of a wide BVH and the test of a ray against their boxes (derived in `trav_ray`).

use bytemuck::{NoUninit, Pod, Zeroable};

use crate::accel::trav_ray::Slabs;
use crate::math::f32x8::F32x8Ops;

/// The largest number of children of a node: the lanes of one vector register (AVX) or of two (SSE,
/// NEON).
pub(super) const WIDTH: usize = 8;

/// A reference to an inner node or to a leaf of primitives.
///
/// The references of a node's children ascend by the number of primitives (0 for inner nodes) and
/// then by slot, in whatever order the nodes of a tree were built: a ray that reaches several at
/// the same t visits them in that order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct NodeRef(u32);

/// The high bits of a [`NodeRef`], which count the primitives of a leaf.
const COUNT_BITS: u32 = 3;
/// The low bits of a [`NodeRef`], which hold the index.
const INDEX_BITS: u32 = u32::BITS - COUNT_BITS;

impl NodeRef {
    /// Makes the reference to an inner node.
    #[inline]
    pub(super) fn inner(node: usize) -> Self {
        Self::pack(node, 0)
    }

    /// Makes the reference to a leaf of up to 7 primitives. Leaves start at multiples of the tree's
    /// leaf size in tree order; `index` counts in those multiples.
    #[inline]
    pub(super) fn leaf(index: usize, count: usize) -> Self {
        assert!((1..1 << COUNT_BITS).contains(&count), "bug in anyhit: a leaf of {count} primitives");
        Self::pack(index, count)
    }

    #[inline]
    fn pack(index: usize, count: usize) -> Self {
        assert!(index < 1 << INDEX_BITS, "bug in anyhit: a BVH of too many nodes");
        Self((count << INDEX_BITS | index) as u32)
    }

    /// The reference as 32 bits.
    #[inline(always)]
    pub(super) fn bits(self) -> u32 {
        self.0
    }

    /// The reference that [`NodeRef::bits`] encoded.
    #[inline(always)]
    pub(super) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// The index of the node or of the leaf.
    #[inline(always)]
    pub(super) fn index(self) -> usize {
        (self.0 & ((1 << INDEX_BITS) - 1)) as usize
    }

    /// The number of primitives; 0 for an inner node.
    #[inline(always)]
    pub(super) fn count(self) -> u32 {
        self.0 >> INDEX_BITS
    }

    #[inline(always)]
    pub(super) fn is_leaf(self) -> bool {
        self.count() != 0
    }

    /// The reference after the given offsets were added to the indices of nodes and leaves.
    pub(super) fn offset_by(self, nodes: usize, leaves: usize) -> Self {
        let by = if self.is_leaf() { leaves } else { nodes };
        Self::pack(self.index() + by, self.count() as usize)
    }

    /// Splits a leaf into leaves of one primitive each, in a tree whose leaf size is 1.
    pub(super) fn single_leaves(self) -> impl DoubleEndedIterator<Item = Self> {
        (0..self.count() as usize).map(move |at| Self::leaf(self.index() + at, 1))
    }
}

/// An inner node: the boxes of its children in scaled units, as a structure of arrays. It fills
/// four cache lines.
#[derive(Clone, Copy, Debug, NoUninit)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// For each axis the lower planes, then the upper ones.
    planes: [[[f32; WIDTH]; 2]; 3],
    children: [NodeRef; WIDTH],
    /// A bit for each slot that holds a child.
    filled: u32,
    unused: [u32; 7],
}

impl Node {
    /// A node without children.
    pub(super) const EMPTY: Self =
        Self { planes: [[[0.0; WIDTH]; 2]; 3], children: [NodeRef(0); WIDTH], filled: 0, unused: [0; 7] };

    /// Makes a node over up to `WIDTH` children with their boxes (scaled; minimum and maximum).
    pub(super) fn new(children: &[(NodeRef, [[f32; 3]; 2])]) -> Self {
        debug_assert!((1..=WIDTH).contains(&children.len()));
        let mut node = Self { filled: (1 << children.len()) - 1, ..Self::EMPTY };
        for (slot, (child, corners)) in children.iter().enumerate() {
            node.children[slot] = *child;
            for (axis, planes) in node.planes.iter_mut().enumerate() {
                planes[0][slot] = corners[0][axis];
                planes[1][slot] = corners[1][axis];
            }
        }
        node
    }

    /// Sets the child in a slot.
    pub(super) fn set_child(&mut self, slot: usize, child: NodeRef) {
        self.children[slot] = child;
    }

    /// Adds the given offsets to the indices of the children that are nodes and of those that are
    /// leaves.
    pub(super) fn offset_children(&mut self, nodes: usize, leaves: usize) {
        for slot in 0..self.filled.count_ones() as usize {
            self.children[slot] = self.children[slot].offset_by(nodes, leaves);
        }
    }

    /// Makes the box of a child too small: a broken tree, which a judge must find.
    #[cfg(any(test, feature = "test-support"))]
    pub(super) fn shrink_box(&mut self, slot: usize) {
        for [low, high] in &mut self.planes {
            high[slot] = low[slot];
        }
    }

    /// The number of children.
    pub(super) fn count(&self) -> usize {
        self.filled.count_ones() as usize
    }

    /// The children with their boxes (scaled).
    #[cfg(test)]
    pub(super) fn children(&self) -> impl Iterator<Item = (NodeRef, [[f32; 3]; 2])> + '_ {
        (0..self.filled.count_ones() as usize).map(|slot| {
            let corner = |side: usize| std::array::from_fn(|axis| self.planes[axis][side][slot]);
            (self.children[slot], [corner(0), corner(1)])
        })
    }

    /// Intersects a ray with the boxes of the children. Returns for each child a lower bound of the
    /// rounded t of any hit in it (in the ray's units, see
    /// [`TravRay::absolute`](super::trav_ray::TravRay::absolute)), and a mask of the children that
    /// the ray may hit up to `limit`, a [`NodeLimit`](super::trav_ray::NodeLimit) in all lanes.
    #[inline(always)]
    pub(super) fn intersect<E: F32x8Ops>(&self, ray: &Slabs<E>, limit: E::F32x8) -> ([f32; WIDTH], u32) {
        let simd = ray.simd;
        let mut near = ray.shifted_t_min;
        let mut far = limit;
        for axis in 0..3 {
            let side = ray.near_side[axis] & 1;
            // The planes come second, so that they are operands in memory.
            let enter = simd.sub(ray.near_origin[axis], simd.load(&self.planes[axis][side]));
            let leave = simd.sub(ray.far_origin[axis], simd.load(&self.planes[axis][side ^ 1]));
            near = simd.max(simd.mul(enter, ray.negated_near_reciprocal[axis]), near);
            far = simd.min(simd.mul(leave, ray.negated_far_reciprocal[axis]), far);
        }
        let maybe_hit = simd.cmp_ge(far, near);
        (simd.to_array(near), maybe_hit & self.filled)
    }

    /// The lower (`side` 0) or upper (1) plane on an axis of the box of the child in a slot.
    #[inline(always)]
    pub(super) fn plane(&self, axis: usize, side: usize, slot: usize) -> f32 {
        self.planes[axis][side][slot % WIDTH]
    }

    /// The child in a slot.
    #[inline(always)]
    pub(super) fn child(&self, slot: usize) -> NodeRef {
        self.children[slot % WIDTH]
    }
}
