//! Rays in world space as the nodes of a tree take them, all in f32: the common case.

use std::ops::RangeInclusive;

use crate::geometry::Ray;
use crate::math::array;
use crate::math::f32x8::F32x8Ops;

/// A ray starts far away if a scaled component of its origin is greater than this.
pub(super) const FAR_AWAY: f64 = 64.0;

/// The scales of trees that take rays in world space in f32.
pub(super) const WORLD_SPACE_SCALES: RangeInclusive<f32> = 1.0 / (1u64 << 60) as f32..=(1u64 << 60) as f32;

/// The slack of a reciprocal, 2^-22 downwards and upwards.
pub(super) const SHRINK: f64 = 1.0 - 1.0 / 4_194_304.0;
pub(super) const WIDEN: f64 = 1.0 + 1.0 / 4_194_304.0;

/// The numbers of a ray: its origin, its direction, and its interval.
const NUMBERS: usize = 8;
/// The numbers of the direction.
const DIRECTION: u32 = 0b0011_1000;

/// The least magnitudes but zero of the numbers of a [well-scaled](Ray::is_well_scaled) ray.
const LEAST: [f32; NUMBERS] = {
    let least = Ray::MIN_MAGNITUDE;
    [least, least, least, least, least, least, 0.0, 0.0]
};

/// Which rays in world space a tree takes in f32: those that are
/// [well-scaled](Ray::is_well_scaled) and start near it.
#[derive(Clone, Copy, Debug)]
pub(super) struct WorldSpaceTree {
    scale: f32,
    /// The greatest magnitudes of the numbers of such a ray.
    greatest: [f32; NUMBERS],
}

impl WorldSpaceTree {
    /// Of a tree with a scale.
    pub(super) fn new(scale: f64) -> Self {
        let scale = scale as f32;
        let most = Ray::MAX_MAGNITUDE;
        // A magnitude is not negative: no ray starts near a tree of another scale.
        let origin =
            if WORLD_SPACE_SCALES.contains(&scale) { most.min(FAR_AWAY as f32 / scale) } else { -1.0 };
        let infinity = f32::INFINITY;
        Self { scale, greatest: [origin, origin, origin, most, most, most, infinity, infinity] }
    }
}

/// A ray in world space in the units of a tree: what its slabs are made of.
///
/// Scaling a well-scaled ray is exact. A reciprocal rounds once, and once more when it is shrunk or
/// widened by 2^-22: 2^-23 of that is left, where the difference needs 2^-24.
#[derive(Clone, Copy, Debug)]
pub(super) struct WorldSpaceRay {
    pub origin: [f32; 3],
    pub negated_near_reciprocal: [f32; 3],
    pub negated_far_reciprocal: [f32; 3],
    /// For each axis the plane that is entered first: 0 the lower, 1 the upper.
    pub near_side: [usize; 3],
}

impl WorldSpaceRay {
    /// `None` for a ray that the tree does not take in f32.
    #[inline(always)]
    pub(super) fn new<E: F32x8Ops>(simd: E, ray: &Ray, tree: &WorldSpaceTree) -> Option<Self> {
        let numbers = simd.load(bytemuck::cast_ref(ray));
        let (zero, magnitudes) = (simd.splat(0.0), simd.abs(numbers));
        let is_zero = simd.cmp_ge(zero, magnitudes);
        let is_some = simd.cmp_ge(magnitudes, simd.load(&LEAST));
        let within = simd.cmp_ge(simd.load(&tree.greatest), magnitudes);
        if within & (is_some | is_zero) != 0xFF || is_zero & DIRECTION == DIRECTION {
            return None;
        }
        // A direction of -0 counts as upwards, like 0: both have an infinite reciprocal.
        let scaled = simd.mul(simd.add(numbers, zero), simd.splat(tree.scale));
        let reciprocals = simd.div(simd.splat(1.0), scaled);
        let upwards = simd.cmp_ge(numbers, zero);
        let [x, y, z, ..] = simd.to_array(scaled);
        let [.., near_x, near_y, near_z, _, _] =
            simd.to_array(simd.mul(reciprocals, simd.splat(-SHRINK as f32)));
        let [.., far_x, far_y, far_z, _, _] = simd.to_array(simd.mul(reciprocals, simd.splat(-WIDEN as f32)));
        Some(Self {
            origin: [x, y, z],
            negated_near_reciprocal: [near_x, near_y, near_z],
            negated_far_reciprocal: [far_x, far_y, far_z],
            near_side: array::map([3, 4, 5], |number| (!upwards >> number & 1) as usize),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::baseline_simd::BaselineSimd;

    #[test]
    fn a_tree_takes_well_scaled_rays_that_start_near_it() {
        let tree = |scale: f64| WorldSpaceTree::new(scale);
        let takes = |tree: &WorldSpaceTree, ray: &Ray| WorldSpaceRay::new(BaselineSimd, ray, tree).is_some();
        let down = [0.0, 0.0, -1.0];
        let from = |x: f32| Ray::new([x, 0.0, 0.0], down);
        // 64 times the largest coordinate, which is below 1 over the scale.
        for (scale, farthest) in [(1.0, 64.0), (0.25, 256.0), (8.0, 8.0)] {
            assert!(takes(&tree(scale), &from(farthest)) && takes(&tree(scale), &from(-farthest)));
            assert!(!takes(&tree(scale), &from(farthest.next_up())), "{scale}");
        }
        // The range of scales is from 2^-60 to 2^60.
        assert!(takes(&tree(60f64.exp2()), &from(0.0)) && !takes(&tree(61f64.exp2()), &from(0.0)));
        assert!(takes(&tree((-60f64).exp2()), &from(0.0)) && !takes(&tree((-61f64).exp2()), &from(0.0)));
        // Every number decides by itself, as `Ray::is_well_scaled` says.
        let numbers = [0.0, -0.0, 1e-30, -1e-30, 0.5, -3.0, 1e30, f32::INFINITY, f32::NAN];
        for at in 0..NUMBERS {
            for number in numbers {
                let mut all: [f32; NUMBERS] = [0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 9.0];
                all[at] = number;
                let ray: Ray = bytemuck::cast(all);
                assert_eq!(takes(&tree(1.0), &ray), ray.is_well_scaled(), "{ray:?}");
            }
        }
        assert!(!takes(&tree(1.0), &Ray::new([0.5; 3], [0.0, -0.0, 0.0])), "it goes nowhere");
    }

    #[test]
    fn a_ray_of_powers_of_two_has_its_slabs_by_hand() {
        let ray = Ray::new([1.0, -2.0, 0.5], [-2.0, -0.0, 0.25]);
        let prepared = WorldSpaceRay::new(BaselineSimd, &ray, &WorldSpaceTree::new(4.0)).expect("near by");
        assert_eq!(prepared.origin, [4.0, -8.0, 2.0]);
        // 1 / (-2 4), 1 / 0, 1 / (1/4 4), times 1 -+ 2^-22.
        let (shrunk, widened) = (1.0 - (-22f32).exp2(), 1.0 + (-22f32).exp2());
        let infinity = f32::NEG_INFINITY;
        assert_eq!(prepared.negated_near_reciprocal, [0.125 * shrunk, infinity, -shrunk]);
        assert_eq!(prepared.negated_far_reciprocal, [0.125 * widened, infinity, -widened]);
        assert_eq!(prepared.near_side, [1, 0, 0]);
    }
}
