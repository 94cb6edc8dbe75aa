//! The BVH and the leaf loop that all contenders share: four-wide nodes over leaves of one block.

use anyhit_engine::geometry::Ray;
use anyhit_engine::math::f32x4::F32x4;
use anyhit_engine::math::lane_ops::LaneOps;

use crate::contender::PlacedInstance;
use crate::shape::Corners;

struct Node {
    planes: [[[f32; 4]; 3]; 2],
    /// For each slot the index of a node, or the complement of the index of a leaf's block, or
    /// none.
    children: [Option<i32>; 4],
}

/// A tree over boxes.
pub struct Bvh {
    nodes: Vec<Node>,
    /// The numbers of the boxes in each block.
    pub blocks: Vec<Vec<u32>>,
}

/// A ray for the nodes in plain f32; the boxes are padded for its errors.
#[derive(Clone, Copy)]
pub struct TravRay {
    origin: [f32; 3],
    inverse: [f32; 3],
}

impl TravRay {
    #[inline(always)]
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        Self { origin, inverse: direction.map(|x| 1.0 / x) }
    }

    /// The ray in the object space of an instance.
    #[inline(always)]
    pub fn in_object(ray: &Ray, placed: &PlacedInstance) -> Self {
        if placed.transform.is_none() {
            return Self::new(ray.origin, ray.direction);
        }
        let m = &placed.inverse;
        let apply =
            |v: [f32; 3], w: f32| m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2] + row[3] * w);
        Self::new(apply(ray.origin, 1.0), apply(ray.direction, 0.0))
    }
}

/// Visits the blocks that a ray reaches. (A closure would not be compiled for the instruction set.)
pub trait LeafVisitor {
    /// Visits a block and returns the new limit. Implementations must be inlined.
    fn visit<V: LaneOps>(&mut self, simd: V, block: usize, limit: f32) -> f32;
}

impl Bvh {
    /// Builds a BVH by the surface area heuristic, over all three axes.
    pub fn build(boxes: &[Corners]) -> Self {
        let size = boxes.iter().flatten().flatten().fold(0f32, |a, x| a.max(x.abs()));
        // More than what rounding the ray and the test can lose.
        let pad = size * 4e-6;
        let padded: Vec<Corners> =
            boxes.iter().map(|[low, high]| [low.map(|x| x - pad), high.map(|x| x + pad)]).collect();
        let mut tree = Self { nodes: Vec::new(), blocks: Vec::new() };
        let mut all: Vec<u32> = (0..boxes.len() as u32).collect();
        tree.node(&padded, &mut all);
        tree
    }

    fn node(&mut self, boxes: &[Corners], numbers: &mut [u32]) -> i32 {
        if numbers.len() <= 4 {
            self.blocks.push(numbers.to_vec());
            return !(self.blocks.len() as i32 - 1);
        }
        let place = self.nodes.len();
        self.nodes.push(Node {
            planes: [[[f32::INFINITY; 4]; 3], [[f32::NEG_INFINITY; 4]; 3]],
            children: [None; 4],
        });
        let mut parts = vec![numbers];
        while parts.len() < 4 {
            let most = (0..parts.len()).max_by_key(|&i| parts[i].len()).expect("parts");
            if parts[most].len() <= 4 {
                break;
            }
            let part = parts.swap_remove(most);
            let (a, b) = split(boxes, part);
            parts.extend([a, b]);
        }
        for (slot, part) in parts.into_iter().enumerate() {
            let [low, high] = around(boxes, part);
            for axis in 0..3 {
                self.nodes[place].planes[0][axis][slot] = low[axis];
                self.nodes[place].planes[1][axis][slot] = high[axis];
            }
            let child = self.node(boxes, part);
            self.nodes[place].children[slot] = Some(child);
        }
        place as i32
    }

    /// Visits the blocks that a ray may meet before `limit`, the nearest first; returns the last
    /// limit.
    #[inline(always)]
    pub fn traverse<V: LaneOps>(
        &self,
        simd: V,
        ray: &TravRay,
        mut limit: f32,
        leaves: &mut impl LeafVisitor,
    ) -> f32 {
        let mut stack = [(0f32, 0i32); 96];
        let mut top = 0;
        if self.nodes.is_empty() {
            return leaves.visit(simd, 0, limit);
        }
        stack[0] = (0.0, 0);
        top += 1;
        while top > 0 {
            top -= 1;
            let (entry, index) = stack[top];
            if entry > limit {
                continue;
            }
            if index < 0 {
                limit = leaves.visit(simd, !index as usize, limit);
                continue;
            }
            let node = &self.nodes[index as usize];
            let mut near = F32x4::splat(0.0);
            let mut far = F32x4::splat(limit);
            for axis in 0..3 {
                let origin = F32x4::splat(ray.origin[axis]);
                let inverse = F32x4::splat(ray.inverse[axis]);
                let side = usize::from(ray.inverse[axis] < 0.0);
                near = ((F32x4::new(node.planes[side][axis]) - origin) * inverse).relaxed_max(near);
                far = ((F32x4::new(node.planes[side ^ 1][axis]) - origin) * inverse).relaxed_min(far);
            }
            let mut maybe_hit = far.cmp_ge(near);
            let near = near.to_array();
            let first = top;
            while maybe_hit != 0 {
                let slot = maybe_hit.trailing_zeros() as usize;
                maybe_hit &= maybe_hit - 1;
                let Some(child) = node.children[slot] else { continue };
                let mut at = top;
                while at > first && stack[at - 1].0 < near[slot] {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = (near[slot], child);
                top += 1;
            }
        }
        limit
    }
}

fn around(boxes: &[Corners], numbers: &[u32]) -> Corners {
    numbers.iter().fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |[low, high], &number| {
        let [a, b] = boxes[number as usize];
        [std::array::from_fn(|i| low[i].min(a[i])), std::array::from_fn(|i| high[i].max(b[i]))]
    })
}

fn half_area([low, high]: Corners) -> f32 {
    let [x, y, z]: [f32; 3] = std::array::from_fn(|i| high[i] - low[i]);
    x * y + y * z + z * x
}

fn split<'a>(boxes: &[Corners], numbers: &'a mut [u32]) -> (&'a mut [u32], &'a mut [u32]) {
    let middle = |number: u32, axis: usize| boxes[number as usize][0][axis] + boxes[number as usize][1][axis];
    let mut best = (f32::INFINITY, 0, numbers.len() / 2);
    for axis in 0..3 {
        numbers.sort_unstable_by(|&a, &b| middle(a, axis).total_cmp(&middle(b, axis)).then(a.cmp(&b)));
        let mut right = vec![0f32; numbers.len()];
        let mut all = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        let grow = |all: &mut Corners, number: u32| {
            let [a, b] = boxes[number as usize];
            for i in 0..3 {
                all[0][i] = all[0][i].min(a[i]);
                all[1][i] = all[1][i].max(b[i]);
            }
        };
        for place in (1..numbers.len()).rev() {
            grow(&mut all, numbers[place]);
            right[place] = half_area(all) * (numbers.len() - place).div_ceil(4) as f32;
        }
        let mut all = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for place in 1..numbers.len() {
            grow(&mut all, numbers[place - 1]);
            let cost = half_area(all) * place.div_ceil(4) as f32 + right[place];
            if cost < best.0 {
                best = (cost, axis, place);
            }
        }
    }
    let (_, axis, place) = best;
    numbers.sort_unstable_by(|&a, &b| middle(a, axis).total_cmp(&middle(b, axis)).then(a.cmp(&b)));
    numbers.split_at_mut(place)
}
