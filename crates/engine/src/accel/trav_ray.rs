//! A ray prepared for the nodes of a BVH, with widened slabs: their test never loses a hit.
//!
//! **Units.** A tree's boxes are stored times a power of two (its *scale*) that brings the largest
//! coordinate into the unit cube; the ray's origin and direction are scaled alike, so that t keeps
//! its meaning. For a ray that starts far away (64 times the largest coordinate), t is counted from
//! `t_shift`, an f32 not above its entry into the root; the origin moves there. Then every number
//! of the test is of moderate size, and the slack of the test (2^-22 of t) is far below the
//! boxes.
//!
//! **The test.** On one axis let the exact origin lie in [o-, o+] and the exact direction in
//! [d-, d+], all f32. For d- > 0 and t >= 0, a point with lo <= o + d t <= hi has
//!
//! ```text
//! (lo - o+) / d+  <=  t  <=  (hi - o-) / d-
//! ```
//!
//! and mirrored for d+ < 0. The difference rounds with a relative error of at most 2^-24 (never
//! through zero); the reciprocals are rounded down or up after they were shrunk or widened by
//! 2^-22. So the exact product of the two f32 factors bounds t, and since rounding is monotone, the
//! computed near and far bound the *rounded* t of any hit, through underflow and overflow alike.
//! (Widening the reciprocal instead of the product follows Ize, "Robust BVH Ray Traversal", 2013;
//! there the origin and direction are exact.)
//!
//! Where [d-, d+] holds zero, the origin is widened by |d| times the largest t of interest, the
//! reciprocals are infinite, and the slab only asks whether the origin lies within; infinity times
//! zero gives NaN, which each comparison below ignores (the box is kept).

use std::ops::RangeInclusive;

use crate::accel::world_space_ray::{FAR_AWAY, SHRINK, WIDEN, WorldSpaceRay, WorldSpaceTree};
use crate::geometry::{ApproximateRay, Bounds, ObjectRay, Ray};
use crate::math::baseline_simd::BaselineSimd;
use crate::math::f32x4::{F32x4, LANES};
use crate::math::f32x8::F32x8Ops;

/// The unit roundoff of f64.
const U: f64 = 1.0 / 9_007_199_254_740_992.0;

/// The largest t of interest, in the units of a [`TravRay`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NodeLimit(pub(super) f32);

/// A number for each axis, in all lanes. (No closure: one that is not inlined takes its vectors
/// through memory.)
#[inline(always)]
fn splat_axes<E: F32x8Ops>(simd: E, &[x, y, z]: &[f32; 3]) -> [E::F32x8; 3] {
    [simd.splat(x), simd.splat(y), simd.splat(z)]
}

/// The first three of four numbers.
#[inline(always)]
fn first_three(numbers: &[f32; LANES]) -> &[f32; 3] {
    numbers.first_chunk().expect("three of four")
}

/// A ray prepared for the nodes of one tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct TravRay {
    /// For each axis one number; the fourth is not used.
    pub(super) near_origin: [f32; LANES],
    pub(super) far_origin: [f32; LANES],
    /// The negated reciprocals of the direction.
    pub(super) negated_near_reciprocal: [f32; LANES],
    pub(super) negated_far_reciprocal: [f32; LANES],
    /// For each axis the plane that is entered first: 0 the lower, 1 the upper.
    pub(super) near_side: [usize; 3],
    t_shift: f32,
    t_min: f32,
    /// `t_min` counted from the shift, rounded down; not -0.
    pub(super) shifted_t_min: f32,
}

/// The slabs of a [`TravRay`] in SIMD registers, each number in all lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slabs<E: F32x8Ops> {
    pub(super) simd: E,
    pub(super) near_origin: [E::F32x8; 3],
    pub(super) far_origin: [E::F32x8; 3],
    pub(super) negated_near_reciprocal: [E::F32x8; 3],
    pub(super) negated_far_reciprocal: [E::F32x8; 3],
    pub(super) shifted_t_min: E::F32x8,
    /// For each axis the plane that is entered first: 0 the lower, 1 the upper.
    pub(super) near_side: [usize; 3],
}

/// The scales of trees that [approximate](TravRay::set_approximate) rays support.
pub(super) const APPROXIMATE_SCALES: RangeInclusive<f32> = 1.0 / (1u64 << 20) as f32..=(1u64 << 20) as f32;

impl NodeLimit {
    /// The limit of a ray whose t is not shifted.
    #[inline(always)]
    pub(super) fn unshifted(t: f32) -> Self {
        // An infinite t would let boxes at infinity pass.
        Self(t.min(f32::MAX))
    }
}

impl TravRay {
    /// Placeholder value.
    pub(super) const EMPTY: Self = Self {
        near_origin: [0.0; LANES],
        far_origin: [0.0; LANES],
        negated_near_reciprocal: [0.0; LANES],
        negated_far_reciprocal: [0.0; LANES],
        near_side: [0; 3],
        t_shift: 0.0,
        t_min: 0.0,
        shifted_t_min: 0.0,
    };

    /// A ray that holds only `t_min`, for a TLAS without a tree.
    pub(super) fn with_t_min(t_min: f32) -> Self {
        Self { t_min, shifted_t_min: t_min + 0.0, ..Self::EMPTY }
    }

    /// Prepares a ray for a tree with the given root box (in the tree's space, not scaled) and
    /// scale (a power of two). `None` if the ray certainly misses the root within
    /// `t_min..=t_max`.
    #[inline]
    pub(super) fn new(ray: &ObjectRay, t_max: f32, root: &Bounds, scale: f64) -> Option<Self> {
        let mut world_space = Self::EMPTY;
        if ray.is_in_world() && world_space.set_world_space(ray.world(), &WorldSpaceTree::new(scale)) {
            return Some(world_space);
        }
        let (origin, _) = ray.origin_bounded();
        let (direction, bounds) = ray.direction_bounded();
        let far_away = origin.iter().any(|x| x.is_nan() || (x * scale).abs() > FAR_AWAY);
        let uncertain = (0..3).any(|axis| is_parallel(direction[axis], bounds[axis]) && bounds[axis] != 0.0);
        if far_away || uncertain {
            // Only then does it matter where the ray enters and leaves the root.
            let (enter, leave) = root_interval(ray, t_max, root)?;
            let t_shift = if far_away { t_shift(enter) } else { 0.0 };
            return Some(Self::with_t_shift(ray, t_shift, leave, scale));
        }
        Some(Self::with_t_shift(ray, 0.0, f64::INFINITY, scale))
    }

    /// Prepares a [well-scaled](Ray::is_well_scaled) ray in world space that starts near the tree,
    /// all in f32: the common case. Returns whether it is one.
    #[inline(always)]
    pub(super) fn set_world_space(&mut self, ray: &Ray, tree: &WorldSpaceTree) -> bool {
        let Some(in_tree) = WorldSpaceRay::new(BaselineSimd, ray, tree) else { return false };
        let four = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        self.near_origin = four(in_tree.origin);
        self.far_origin = self.near_origin;
        self.negated_near_reciprocal = four(in_tree.negated_near_reciprocal);
        self.negated_far_reciprocal = four(in_tree.negated_far_reciprocal);
        self.near_side = in_tree.near_side;
        (self.t_shift, self.t_min, self.shifted_t_min) = (0.0, ray.t_min, ray.t_min + 0.0);
        true
    }

    /// Prepares a ray in an instance that starts near the tree, and each component of whose
    /// direction is 0 or has a small error, all in f32: the common case. Returns whether it is one.
    ///
    /// Scaling is exact. The origin's sum rounds, and so does a reciprocal's sum, its division and
    /// its product; the bounds of an approximate ray are twice what is needed and pay for 6u of
    /// that.
    #[inline(always)]
    pub(super) fn set_approximate(&mut self, ray: &ApproximateRay, t_min: f32, scale: f64) -> bool {
        let scale = scale as f32;
        let all = |x: f32| F32x4::splat(x);
        let origin = ray.origin * all(scale);
        let size = ray.direction.abs();
        let near_by = all(FAR_AWAY as f32).cmp_ge(origin.abs());
        let known = size.cmp_ge(ray.direction_error * all(4.0));
        if !(near_by & known == 0b1111 && APPROXIMATE_SCALES.contains(&scale)) {
            return false;
        }
        let slack = ray.origin_error * all(scale);
        let (below, above) = (origin - slack, origin + slack);
        let min_reciprocal = all(1.0) / ((size + ray.direction_error) * all(scale));
        let max_reciprocal = all(1.0) / ((size - ray.direction_error) * all(scale));
        let near = (min_reciprocal * all(-SHRINK as f32)).to_array();
        let far = (max_reciprocal * all(-WIDEN as f32)).to_array();
        let (below, above, direction) = (below.to_array(), above.to_array(), ray.direction.to_array());
        for axis in 0..3 {
            let downwards = direction[axis] < 0.0;
            let (first, last, sign) =
                if downwards { (below[axis], above[axis], -1.0) } else { (above[axis], below[axis], 1.0) };
            self.near_side[axis] = usize::from(downwards);
            (self.near_origin[axis], self.far_origin[axis]) = (first, last);
            (self.negated_near_reciprocal[axis], self.negated_far_reciprocal[axis]) =
                (near[axis] * sign, far[axis] * sign);
        }
        (self.t_shift, self.t_min, self.shifted_t_min) = (0.0, t_min, t_min + 0.0);
        true
    }

    /// The slabs of the ray in SIMD registers.
    #[inline(always)]
    pub(super) fn slabs<E: F32x8Ops>(&self, simd: E) -> Slabs<E> {
        Slabs {
            simd,
            near_origin: splat_axes(simd, first_three(&self.near_origin)),
            far_origin: splat_axes(simd, first_three(&self.far_origin)),
            negated_near_reciprocal: splat_axes(simd, first_three(&self.negated_near_reciprocal)),
            negated_far_reciprocal: splat_axes(simd, first_three(&self.negated_far_reciprocal)),
            shifted_t_min: simd.splat(self.shifted_t_min),
            near_side: self.near_side,
        }
    }

    /// Whether the ray surely misses a tree's root box within `t_min..=t_max`.
    pub(super) fn misses(ray: &ObjectRay, t_max: f32, root: &Bounds) -> bool {
        root_interval(ray, t_max, root).is_none()
    }

    /// Prepares a ray with t counted from a shift; `leave` is the largest t of interest.
    #[inline(always)]
    fn with_t_shift(ray: &ObjectRay, t_shift: f32, leave: f64, scale: f64) -> Self {
        let t_min = ray.t_min();
        let (near_by, origin_bounds) = ray.origin_bounded();
        let (along, direction_bounds) = ray.direction_bounded();
        let mut out = Self {
            negated_near_reciprocal: [f32::NEG_INFINITY; LANES],
            negated_far_reciprocal: [f32::NEG_INFINITY; LANES],
            t_shift,
            t_min,
            shifted_t_min: if t_shift == 0.0 { t_min + 0.0 } else { 0.0 },
            ..Self::EMPTY
        };
        let shift = f64::from(t_shift);
        for axis in 0..3 {
            let (d, d_bound) = (along[axis], direction_bounds[axis]);
            let mut origin = near_by[axis];
            let mut bound = origin_bounds[axis];
            if shift != 0.0 {
                let moved = shift * d;
                origin += moved;
                bound += shift * d_bound + (moved.abs() + origin.abs()) * (2.0 * U);
                bound *= 1.0 + 8.0 * U;
            }
            let parallel = is_parallel(d, d_bound);
            if parallel && d_bound != 0.0 {
                // |d t| over the interval of t that is left.
                bound = (bound + (leave - shift) * (2.0 * d_bound)) * (1.0 + 8.0 * U);
            }
            if !(origin.is_finite() && bound.is_finite()) {
                (origin, bound) = (0.0, f64::INFINITY);
            }
            // Scaling is exact, the sums round: one ulp of f64 further out, then on to f32.
            let (low, high) = if bound == 0.0 {
                bracket(origin * scale)
            } else {
                let low = round_down(((origin - bound) * scale).next_down());
                (low, round_up(((origin + bound) * scale).next_up()))
            };
            let upwards = d > 0.0 || parallel;
            out.near_side[axis] = usize::from(!upwards);
            let (near, far) = if upwards { (high, low) } else { (low, high) };
            (out.near_origin[axis], out.far_origin[axis]) = (near, far);
            if parallel {
                continue;
            }
            // Largest and smallest magnitude of the scaled direction. The sums and divisions in f64
            // err by 4u, far below the slack of 2^-22.
            let (min_reciprocal, max_reciprocal) = if d_bound == 0.0 {
                let reciprocal = 1.0 / (d.abs() * scale);
                (reciprocal, reciprocal)
            } else {
                (1.0 / ((d.abs() + d_bound) * scale), 1.0 / ((d.abs() - d_bound) * scale))
            };
            let near = round_down(SHRINK * min_reciprocal);
            let far = round_up(WIDEN * max_reciprocal);
            let (near, far) = if upwards { (-near, -far) } else { (near, far) };
            (out.negated_near_reciprocal[axis], out.negated_far_reciprocal[axis]) = (near, far);
        }
        out
    }

    /// The limit for a largest t of interest (absolute, t >= 0): no hit whose rounded t is at most
    /// `t` has a near bound above it.
    #[inline]
    pub(super) fn limit(&self, t: f32) -> NodeLimit {
        let NodeLimit(t) = NodeLimit::unshifted(t);
        if self.t_shift == 0.0 {
            return NodeLimit(t);
        }
        // The exact t of such a hit is at most half an ulp above; then it is counted from the shift
        // and rounded once more.
        let (t, shift) = (f64::from(t), f64::from(self.t_shift));
        NodeLimit(round_up((t - shift) + t / 2_097_152.0).next_up())
    }

    /// A near bound counted from the shift as a lower bound of the rounded absolute t.
    #[inline]
    pub(super) fn absolute(&self, near: f32) -> f32 {
        let entry = if self.t_shift == 0.0 {
            near
        } else {
            // `near` bounds the rounded distance: half an ulp may have been added, and the sum
            // rounds once. (The shift is far above the subnormal numbers.)
            (self.t_shift + near) * (1.0 - 1.0 / 2_097_152.0)
        };
        if entry > self.t_min { entry } else { self.t_min }
    }
}

impl<E: F32x8Ops> Slabs<E> {
    /// The slabs of a ray in world space with a `t_min`.
    #[inline(always)]
    pub(super) fn in_world(simd: E, in_tree: &WorldSpaceRay, t_min: f32) -> Self {
        let origin = splat_axes(simd, &in_tree.origin);
        Self {
            simd,
            near_origin: origin,
            far_origin: origin,
            negated_near_reciprocal: splat_axes(simd, &in_tree.negated_near_reciprocal),
            negated_far_reciprocal: splat_axes(simd, &in_tree.negated_far_reciprocal),
            shifted_t_min: simd.splat(t_min + 0.0),
            near_side: in_tree.near_side,
        }
    }
}

/// The interval of t within the root box, rounded outwards and clipped to `t_min..=t_max`.
fn root_interval(ray: &ObjectRay, t_max: f32, root: &Bounds) -> Option<(f64, f64)> {
    let (origin, origin_bound) = ray.origin_bounded();
    let (direction, direction_bound) = ray.direction_bounded();
    let mut enter = f64::from(ray.t_min());
    // A hit whose t rounds to t_max can lie half an ulp above it.
    let mut leave = if t_max < f32::MAX { f64::from(t_max.next_up()) } else { 129f64.exp2() };
    for axis in 0..3 {
        let (o, d) = (origin[axis], direction[axis]);
        let (o_bound, d_bound) = (origin_bound[axis], direction_bound[axis]);
        let (low, high) = (f64::from(root.min[axis]), f64::from(root.max[axis]));
        if is_parallel(d, d_bound) {
            if d_bound == 0.0 && (o + o_bound < low || o - o_bound > high) {
                return None;
            }
            continue;
        }
        let (near_plane, far_plane) = if d > 0.0 { (low, high) } else { (high, low) };
        // As in the head of this file, mirrored to d > 0; the bound widens by the rounding of the
        // sum, each factor by the rest.
        let sign = d.signum();
        let slack = if o_bound == 0.0 { 0.0 } else { o_bound + (o.abs() + o_bound) * (4.0 * U) };
        let near = ((near_plane - o) * sign - slack) / (d.abs() + d_bound);
        let far = ((far_plane - o) * sign + slack) / (d.abs() - d_bound);
        // Relative 4u each way; a negative near does not matter, a negative far misses.
        let near = near * (1.0 - 8.0 * U);
        let far = far * (1.0 + 8.0 * U);
        if near > enter {
            enter = near;
        }
        if far < leave {
            leave = far;
        }
    }
    (enter <= leave).then_some((enter, leave))
}

/// Whether a component of the direction may be zero or is NaN.
fn is_parallel(d: f64, d_bound: f64) -> bool {
    d.is_nan() || d.abs() <= d_bound
}

/// The t from which t is counted: an f32 at or below `enter`, or 0.
fn t_shift(enter: f64) -> f32 {
    // Below 2^-60 the sums of t would meet the subnormal numbers.
    if enter < 1.0 / (1u64 << 60) as f64 { 0.0 } else { round_down(enter) }
}

/// The f32 below and above x; both are x where it is one.
#[inline(always)]
fn bracket(x: f64) -> (f32, f32) {
    let near = x as f32;
    if f64::from(near) == x { (near, near) } else { (round_down(x), round_up(x)) }
}

/// The largest f32 not above x.
#[inline]
pub(super) fn round_down(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// The smallest f32 not below x.
#[inline]
pub(super) fn round_up(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x { near.next_up() } else { near }
}

#[cfg(test)]
mod tests {
    use dashu_ratio::RBig;
    use proptest::prelude::*;

    use super::*;
    use crate::accel::binned_sah::SahCost;
    use crate::accel::node::{Node, WIDTH};
    use crate::accel::wide_bvh::WideBvh;
    use crate::geometry::Transform;
    use crate::math::baseline_simd::BaselineSimd;

    fn exact(x: f32) -> RBig {
        RBig::try_from(x).expect("finite")
    }

    /// Solves m x = v by Cramer's rule; `None` for a singular m.
    fn solve(m: &[[f32; 4]; 3], v: &[RBig; 3]) -> Option<[RBig; 3]> {
        let columns: [[RBig; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| exact(m[i][j])));
        let determinant = |c: &[[RBig; 3]; 3]| {
            let minor = |a: usize, b: usize| &c[1][a] * &c[2][b] - &c[1][b] * &c[2][a];
            &c[0][0] * minor(1, 2) + &c[0][1] * minor(2, 0) + &c[0][2] * minor(0, 1)
        };
        let whole = determinant(&columns);
        (whole != RBig::ZERO).then(|| {
            std::array::from_fn(|k| {
                let mut replaced = columns.clone();
                for (row, x) in replaced.iter_mut().zip(v) {
                    row[k] = x.clone();
                }
                determinant(&replaced) / &whole
            })
        })
    }

    /// The exact t at which the ray is first in the box, from `t_min` on.
    fn exact_entry(o: &[RBig; 3], d: &[RBig; 3], bounds: &Bounds, t_min: f32, t_max: f32) -> Option<RBig> {
        let (mut enter, mut leave) = (exact(t_min), exact(t_max));
        for axis in 0..3 {
            let (low, high) = (exact(bounds.min[axis]) - &o[axis], exact(bounds.max[axis]) - &o[axis]);
            if d[axis] == RBig::ZERO {
                if low > RBig::ZERO || high < RBig::ZERO {
                    return None;
                }
                continue;
            }
            let (a, b) = (low / &d[axis], high / &d[axis]);
            let (near, far) = if a < b { (a, b) } else { (b, a) };
            enter = enter.max(near);
            leave = leave.min(far);
        }
        (enter <= leave).then_some(enter)
    }

    /// Numbers of one scale, many of them alike, so that rays meet faces, edges and corners.
    fn coarse(scale: i32) -> impl Strategy<Value = f32> {
        prop_oneof![
            (-4i32..=4).prop_map(move |k| k as f32 * (scale as f32).exp2()),
            (-1f32..1f32).prop_map(move |x| x * (scale as f32).exp2()),
        ]
    }

    fn point(scale: i32) -> impl Strategy<Value = [f32; 3]> {
        prop::array::uniform3(coarse(scale))
    }

    /// Boxes, many of them flat or thin.
    fn boxes(scale: i32) -> impl Strategy<Value = Vec<Bounds>> {
        let thickness = prop_oneof![Just(0f32), Just(1e-7), Just(1e-3), Just(1.0)];
        let one = (point(scale), point(scale), thickness).prop_map(|(a, by, thickness)| {
            let b: [f32; 3] = std::array::from_fn(|k| a[k] + by[k] * thickness);
            Bounds {
                min: std::array::from_fn(|k| a[k].min(b[k])),
                max: std::array::from_fn(|k| a[k].max(b[k])),
            }
        });
        prop::collection::vec(one, 5)
    }

    /// Checks that no box that the exact ray hits is lost, and that no entry lies above the rounded
    /// t.
    fn check(boxes: &[Bounds], matrix: Option<[[f32; 4]; 3]>, ray: Ray) -> Result<bool, TestCaseError> {
        let Some(object_ray) = ObjectRay::new(&ray, matrix.as_ref()) else { return Ok(false) };
        let (bvh, order) = WideBvh::build(
            boxes,
            SahCost { max_leaf_size: 1, traversal: 1.0, intersection: 1.0, split_below: 1.0 },
        )
        .expect("boxes");
        let prepared = TravRay::new(&object_ray, ray.t_max, bvh.bounds(), bvh.scale());
        let transform = matrix.as_ref().and_then(Transform::new);
        let approximate =
            transform.and_then(|transform| transform.approximate(&ray)).and_then(|approximate| {
                let mut trav_ray = TravRay::EMPTY;
                trav_ray.set_approximate(&approximate, ray.t_min, bvh.scale()).then_some(trav_ray)
            });
        let (mut o, mut d) = (ray.origin.map(exact), ray.direction.map(exact));
        if let Some(m) = matrix {
            let from = std::array::from_fn(|k| &o[k] - exact(m[k][3]));
            (o, d) = (solve(&m, &from).expect("regular"), solve(&m, &d).expect("regular"));
        }
        let mut any = false;
        for place in 0..order.len() as u32 {
            let bounds = &boxes[order[place as usize] as usize];
            let Some(t) = exact_entry(&o, &d, bounds, ray.t_min, ray.t_max) else { continue };
            any = true;
            if prepared.is_none() {
                return Err(TestCaseError::fail(format!("the root is lost: {bounds:?}")));
            }
            for trav_ray in [&prepared, &approximate].into_iter().flatten() {
                // From the root down to the box, each step must let the ray through.
                let rounded = t.to_f32().value();
                let limit = trav_ray.limit(rounded);
                let mut at = bvh.root();
                prop_assert!(trav_ray.absolute(trav_ray.shifted_t_min) <= rounded);
                while !at.is_leaf() {
                    let node: &Node = bvh.node(at);
                    let slabs = trav_ray.slabs(BaselineSimd);
                    let (near, maybe_hit) = node.intersect(&slabs, F32x8Ops::splat(BaselineSimd, limit.0));
                    let entries: [f32; WIDTH] = std::array::from_fn(|slot| {
                        if maybe_hit >> slot & 1 != 0 { trav_ray.absolute(near[slot]) } else { f32::INFINITY }
                    });
                    let slot = (0..entries.len()).find(|&slot| holds(&bvh, node, slot, place));
                    let slot = slot.expect("every box is in the BVH");
                    prop_assert!(
                        entries[slot] <= rounded,
                        "{bounds:?} is entered at {rounded:e}, the node test says {:e}",
                        entries[slot]
                    );
                    at = node.child(slot);
                }
            }
        }
        Ok(any)
    }

    /// Whether a place in tree order lies below a node's slot.
    fn holds(bvh: &WideBvh, node: &Node, slot: usize, place: u32) -> bool {
        let Some((child, _)) = node.children().nth(slot) else { return false };
        if child.is_leaf() {
            return child.index() == place as usize;
        }
        let below = bvh.node(child);
        (0..WIDTH).any(|slot| holds(bvh, below, slot, place))
    }

    /// Boxes and a ray towards a corner, edge or face of one, from far or near; its components are
    /// often zero or equal.
    fn scenes(scale: i32) -> impl Strategy<Value = (Vec<Bounds>, Ray)> {
        let distance = prop_oneof![Just(1f32), Just(8.0), Just(1e6), Just(1e12)];
        let length = prop_oneof![Just(0i32), -40i32..40, Just(-149 - scale), Just(100)];
        let interval =
            prop_oneof![Just((0.0, f32::MAX)), Just((0.0, 1.0)), Just((0.5, 2.0)), Just((0.0, 0.0))];
        let choices = (0usize..5, prop::array::uniform3(0u8..3), prop::array::uniform3(0u8..4));
        (boxes(scale), point(scale), distance, length, choices, interval).prop_map(
            |(boxes, from, distance, length, (aim, corner, keep), (t_min, t_max))| {
                let Bounds { min, max } = boxes[aim];
                let target: [f32; 3] = std::array::from_fn(|k| match corner[k] {
                    0 => min[k],
                    1 => max[k],
                    _ => min[k] * 0.5 + max[k] * 0.5,
                });
                let origin: [f32; 3] = std::array::from_fn(|k| {
                    if keep[k] == 0 { target[k] } else { (from[k] * distance).clamp(-1e38, 1e38) }
                });
                let direction = std::array::from_fn(|k| {
                    let step = (f64::from(target[k]) - f64::from(origin[k])) * f64::from(length).exp2();
                    (step as f32).clamp(-3e38, 3e38)
                });
                (boxes, Ray::new(origin, direction).with_interval(t_min, t_max))
            },
        )
    }

    fn matrices() -> impl Strategy<Value = [[f32; 4]; 3]> {
        prop::array::uniform3(prop::array::uniform4(coarse(0)))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]
        #[test]
        fn no_box_is_lost_in_world_space(
            (boxes, ray) in (-145i32..120).prop_flat_map(scenes),
        ) {
            check(&boxes, None, ray)?;
        }

        #[test]
        fn no_box_is_lost_in_an_instance(
            (boxes, ray) in (-100i32..100).prop_flat_map(scenes),
            matrix in matrices(),
            translated in any::<bool>(),
        ) {
            let mut matrix = matrix;
            if !translated {
                for row in &mut matrix {
                    row[3] = 0.0;
                }
            }
            check(&boxes, Some(matrix), ray)?;
        }

        /// The world ray is the image of one that runs exactly along faces and edges, under a
        /// matrix whose inverse has thirds, sevenths and so on.
        #[test]
        fn no_box_is_lost_that_an_inexact_inverse_leaves_on_the_edge(
            corners in prop::collection::vec((prop::array::uniform3(-4i8..=4), prop::array::uniform3(-4i8..=4)), 5),
            origin in prop::array::uniform3(-4i8..=4),
            direction in prop::array::uniform3(-2i8..=2),
            distance in prop_oneof![Just(0i32), Just(1), Just(1 << 10)],
            matrix in prop::array::uniform3(prop::array::uniform4(-5i8..=5)),
        ) {
            let boxes: Vec<Bounds> = corners
                .iter()
                .map(|(a, b)| Bounds {
                    min: std::array::from_fn(|k| f32::from(a[k].min(b[k]))),
                    max: std::array::from_fn(|k| f32::from(a[k].max(b[k]))),
                })
                .collect();
            let matrix = matrix.map(|row| row.map(f32::from));
            let image = |v: [i32; 3], with_translation: i32| -> [f32; 3] {
                matrix.map(|row| {
                    (0..3).map(|j| row[j] as i32 * v[j]).sum::<i32>() as f32 + row[3] * with_translation as f32
                })
            };
            let start = std::array::from_fn(|k| i32::from(origin[k]) - distance * i32::from(direction[k]));
            let ray = Ray::new(image(start, 1), image(direction.map(i32::from), 0)).with_interval(0.0, 1e30);
            check(&boxes, Some(matrix), ray)?;
        }
    }

    /// The properties above would hold vacuously for rays that miss all boxes.
    #[test]
    fn a_ray_along_a_face_meets_the_box() {
        let unit = Bounds { min: [0.0; 3], max: [1.0; 3] };
        let other = Bounds { min: [5.0; 3], max: [6.0; 3] };
        for scale in [1.0f32, 1e30, 1e-30, 1e-44] {
            let scaled = [unit, other]
                .map(|b| Bounds { min: b.min.map(|x| x * scale), max: b.max.map(|x| x * scale) });
            for axis in 0..3 {
                let mut origin = [scale; 3];
                origin[axis] = -2.0 * scale;
                let mut direction = [0.0; 3];
                direction[axis] = scale;
                let ray = Ray::new(origin, direction).with_interval(0.0, 1e30);
                assert!(check(&scaled, None, ray).expect("not lost"), "{scale:e} {axis}");
            }
        }
    }

    #[test]
    fn rounding_is_directed() {
        let tenth = 0.1f64;
        assert!(f64::from(round_down(tenth)) < tenth && tenth < f64::from(round_up(tenth)));
        assert_eq!(round_down(0.5), 0.5);
        assert_eq!(round_up(0.5), 0.5);
        assert_eq!((round_down(1e60), round_up(1e60)), (f32::MAX, f32::INFINITY));
        assert_eq!((round_down(-1e-60), round_up(-1e-60)), (-f32::from_bits(1), 0.0));
    }
}
