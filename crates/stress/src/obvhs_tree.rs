//! A BVH of another builder over the bounds of the same primitives: an independent judge of ours.
//!
//! The crate `obvhs` builds it, by PLOC (Meister and Bittner, *Parallel Locally-Ordered Clustering
//! for BVH Construction*, 2018) and reinsertion; nothing of `accel` takes part. It is traversed
//! here, in f64 and without pruning by known hits, and what lies in the leaves that a ray meets is
//! left to the exact tests.
//!
//! **No hit is lost.** Boxes are scaled by a power of two into the unit cube, as ours are, since
//! the builder computes areas in f32; they round outwards. On each axis the ray's origin and
//! direction lie in known intervals. The differences and quotients of the slab test round with a
//! relative error of 2^-53 each, and its results are widened by 2^-40.

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use anyhit_engine::geometry::{Bounds, ObjectRay};

/// The share of the nodes that the builder tries to insert elsewhere.
const REINSERTED: f32 = 0.05;

/// The coordinate that stands for infinity: finite ones lie in the unit cube.
const INFINITY_PROXY: f32 = 2.0;

/// The relative slack of the slab test.
const WIDEN: f64 = 1.0 / (1u64 << 40) as f64;

/// A binary BVH over numbered boxes.
pub(super) struct ObvhsTree {
    bvh: Bvh2,
    scale: f64,
}

impl ObvhsTree {
    /// Builds a tree over the boxes of primitives, which are numbered in their order; `None` stands
    /// for primitives that no ray can hit.
    pub(super) fn new(boxes: impl IntoIterator<Item = Option<Bounds>>) -> Self {
        let boxes = boxes.into_iter().enumerate();
        let (numbers, boxes): (Vec<u32>, Vec<Bounds>) =
            boxes.filter_map(|(number, bounds)| Some((number as u32, bounds?))).unzip();
        let coordinates = boxes.iter().flat_map(|one| one.min.into_iter().chain(one.max));
        let largest = coordinates.map(f32::abs).filter(|x| x.is_finite()).fold(0.0, f32::max);
        // The exponent of f32 numbers, subnormal ones included, is an integer of that range.
        let exponent = (-149..=128).find(|&exponent| 2f64.powi(exponent) >= f64::from(largest));
        let scale = 2f64.powi(-exponent.unwrap_or(0));
        let aabbs: Vec<Aabb> = boxes.iter().map(|bounds| scaled(bounds, scale)).collect();
        let mut bvh = Bvh2::default();
        if !aabbs.is_empty() {
            let (distance, precision) = (PlocSearchDistance::Low, SortPrecision::U64);
            bvh = PlocBuilder::new().build(distance, &aabbs, (0..aabbs.len() as u32).collect(), precision, 0);
            ReinsertionOptimizer::default().run(&mut bvh, REINSERTED, None);
            bvh.primitive_indices.iter_mut().for_each(|index| *index = numbers[*index as usize]);
        }
        Self { bvh, scale }
    }

    /// Makes the box of a child of the root too small.
    #[cfg(test)]
    pub(super) fn shrink_box(&mut self) {
        let corner = self.bvh.nodes[1].aabb().min;
        self.bvh.nodes[1].set_aabb(Aabb::new(corner, corner));
    }

    /// Visits every primitive whose box a ray may meet within its interval.
    pub(super) fn visit(&self, ray: &ObjectRay, visit: &mut dyn FnMut(usize)) {
        if self.bvh.nodes.is_empty() {
            return;
        }
        let mut open = vec![0usize];
        while let Some(index) = open.pop() {
            let node = &self.bvh.nodes[index];
            if !self.may_meet(ray, node.aabb()) {
                continue;
            }
            let first = node.first_index as usize;
            if node.is_leaf() {
                let leaf = &self.bvh.primitive_indices[first..first + node.prim_count as usize];
                leaf.iter().for_each(|&number| visit(number as usize));
            } else {
                open.extend([first, first + 1]);
            }
        }
    }

    /// Whether a ray may meet a scaled box within its interval.
    fn may_meet(&self, ray: &ObjectRay, aabb: &Aabb) -> bool {
        let (origin, origin_error) = ray.origin_bounded();
        let (direction, direction_error) = ray.direction_bounded();
        let (mut near, mut far) = (f64::from(ray.t_min()), f64::from(ray.t_max()));
        let infinite =
            |x: f32| if x.abs() >= INFINITY_PROXY { f64::INFINITY.copysign(x.into()) } else { x.into() };
        for axis in 0..3 {
            let [o, e] = [origin[axis], origin_error[axis]].map(|x| x * self.scale);
            let [d, f] = [direction[axis], direction_error[axis]].map(|x| x * self.scale);
            // From the box's side to the farthest origin there may be.
            let (low, high) = (infinite(aabb.min[axis]) - (o + e), infinite(aabb.max[axis]) - (o - e));
            if d.abs() > f {
                let times = [d - f, d + f].map(|d| [low / d, high / d]);
                let all = times.as_flattened();
                if all.iter().any(|t| t.is_nan()) {
                    continue;
                }
                near = near.max(all.iter().copied().fold(f64::INFINITY, f64::min));
                far = far.min(all.iter().copied().fold(f64::NEG_INFINITY, f64::max));
            } else if d == 0.0 && f == 0.0 && (low > WIDEN || high < -WIDEN) {
                return false;
            }
        }
        // Where both are infinite, the widened ones are NaN: such a box is kept.
        let (near, far) = (near - near.abs() * WIDEN, far + far.abs() * WIDEN);
        near <= far || near.is_nan() || far.is_nan()
    }
}

/// A box in scaled units, rounded outwards.
fn scaled(bounds: &Bounds, scale: f64) -> Aabb {
    let round = |x: f32, outwards: fn(f32) -> f32| {
        if !x.is_finite() {
            return INFINITY_PROXY.copysign(x);
        }
        let exact = f64::from(x) * scale;
        let rounded = exact as f32;
        if f64::from(rounded) == exact { rounded } else { outwards(rounded) }
    };
    let [min, max] =
        [bounds.min.map(|x| round(x, f32::next_down)), bounds.max.map(|x| round(x, f32::next_up))];
    Aabb::new(Vec3A::from_array(min), Vec3A::from_array(max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::geometry::Ray;

    fn visited(tree: &ObvhsTree, ray: &Ray) -> Vec<usize> {
        let mut numbers = Vec::new();
        tree.visit(&ObjectRay::in_world(ray).expect("a direction"), &mut |number| numbers.push(number));
        numbers.sort_unstable();
        numbers
    }

    #[test]
    fn boxes_are_met_at_any_scale_exactly_where_they_are() {
        for scale in [1.0, 2f32.powi(-140), 2f32.powi(120)] {
            // A row of unit boxes along x, two apart, of which the third cannot be hit.
            let at =
                |k: usize| Bounds { min: [2.0 * k as f32, 0.0, 0.0], max: [2.0 * k as f32 + 1.0, 1.0, 1.0] };
            let scaled = |Bounds { min, max }: Bounds| Bounds {
                min: min.map(|x| x * scale),
                max: max.map(|x| x * scale),
            };
            let tree = ObvhsTree::new((0..20).map(|k| (k != 2).then(|| scaled(at(k)))));
            let ray = |origin: [f32; 3], direction| Ray::new(origin.map(|x| x * scale), direction);
            let along = ray([-1.0, 1.0, 0.5], [1.0, 0.0, 0.0]);
            assert_eq!(visited(&tree, &along), (0..20).filter(|&k| k != 2).collect::<Vec<_>>());
            let up = ray([8.5, -1.0, 0.5], [0.0, 1.0, 0.0]);
            assert_eq!(visited(&tree, &up), [4]);
            // Exactly along a side, then beside it.
            assert_eq!(visited(&tree, &ray([9.0, -1.0, 0.5], [0.0, 1.0, 0.0])), [4]);
            assert_eq!(visited(&tree, &ray([9.5, -1.0, 0.5], [0.0, 1.0, 0.0])), [0usize; 0]);
            // From within box 4 to its side at t = 0.5.
            let within = ray([8.5, 0.5, 0.5], [scale, 0.0, 0.0]);
            assert_eq!(visited(&tree, &within.with_interval(0.0, 1.0)), [4]);
            assert_eq!(visited(&tree, &within.with_interval(0.0, 1.5)), [4, 5]);
            assert_eq!(visited(&tree, &within.with_interval(0.75, 1.25)), [0usize; 0]);
        }
    }

    #[test]
    fn infinite_boxes_and_none_are_met() {
        let all = f32::INFINITY;
        let half = Bounds { min: [-all, -all, 1.0], max: [all; 3] };
        let tree = ObvhsTree::new([Some(half), Some(Bounds { min: [5.0; 3], max: [5.0; 3] })]);
        let ray = Ray::new([1e30, -1e30, 0.0], [0.0, 0.0, 1.0]);
        assert_eq!(visited(&tree, &ray), [0]);
        assert_eq!(visited(&tree, &Ray::new([0.0; 3], [1.0; 3])), [0, 1]);
        assert_eq!(visited(&ObvhsTree::new([None]), &ray), [0usize; 0]);
    }
}
