//! The nodes of a tree and the test of a ray against them (its derivation: `node_ray`).

use crate::accel::node_ray::{NodeLimit, Slabs};
use crate::math::eight::Eights;

/// How many children a node has at most: the lanes of a vector register (AVX) or of two (SSE, NEON).
pub const WIDTH: usize = 8;

/// A child: an inner node, or a run of primitives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Child {
    /// The node's index, or the first primitive's place in tree order.
    pub first: u32,
    /// How many primitives; 0 for an inner node.
    pub count: u32,
}

/// An inner node: the boxes of its children side by side (structure of arrays), in scaled units.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Node {
    /// Per axis the lower planes, then the upper ones.
    planes: [[[f32; WIDTH]; 2]; 3],
    children: [Child; WIDTH],
    /// How many children there are.
    len: u32,
}

impl Node {
    /// A node over up to `WIDTH` children with their boxes (scaled, minimum and maximum).
    pub fn new(children: &[(Child, [[f32; 3]; 2])]) -> Self {
        debug_assert!((1..=WIDTH).contains(&children.len()));
        let mut node = Self {
            planes: [[[0.0; WIDTH]; 2]; 3],
            children: [Child::default(); WIDTH],
            len: children.len() as u32,
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

    /// The children with their boxes (scaled).
    #[cfg(test)]
    pub fn children(&self) -> impl Iterator<Item = (Child, [[f32; 3]; 2])> + '_ {
        (0..self.len as usize).map(|slot| {
            let corner = |side: usize| std::array::from_fn(|axis| self.planes[axis][side][slot]);
            (self.children[slot], [corner(0), corner(1)])
        })
    }

    /// Where the ray enters each child's box: a lower bound of the rounded t (absolute, at least
    /// `t_min`) of any hit in it, and a bit for each child that it does not surely miss before
    /// `limit`.
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
        (eights.lanes(near), met & ((1 << self.len) - 1))
    }

    /// The child in a slot.
    #[inline]
    pub fn child(&self, slot: usize) -> Child {
        self.children[slot % WIDTH]
    }
}
