//! A ray made ready for the nodes of a tree, so that their test never loses a hit.
//!
//! **Units.** A tree's boxes are stored times a power of two (its *scale*) that brings the largest
//! coordinate into the unit cube; the ray's origin and direction are scaled alike, so that t keeps
//! its meaning. For a ray that starts far away, t is counted from `t_shift`, an f32 not above its
//! entry into the root; the origin moves there. Then every number of the test is of moderate size.
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

use crate::geometry::{Bounds, ObjectRay};

/// The unit roundoff of f64.
const U: f64 = 1.0 / 9_007_199_254_740_992.0;

/// The largest t of interest, in the units of a [`NodeRay`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeLimit(pub(super) f32);

/// A ray made ready for the nodes of one tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeRay {
    pub(super) near_origin: [f32; 3],
    pub(super) far_origin: [f32; 3],
    pub(super) near_reciprocal: [f32; 3],
    pub(super) far_reciprocal: [f32; 3],
    /// Per axis which plane is entered first: 0 the lower, 1 the upper.
    pub(super) near_side: [usize; 3],
    t_shift: f32,
    t_min: f32,
    /// `t_min` counted from the shift, rounded down.
    pub(super) near_floor: f32,
}

/// The slack of a reciprocal, 2^-22 downwards and upwards.
const SHRINK: f64 = 1.0 - 1.0 / 4_194_304.0;
const WIDEN: f64 = 1.0 + 1.0 / 4_194_304.0;

impl NodeRay {
    /// Prepares a ray for a tree with the given root box (in the tree's space, not scaled) and
    /// scale (a power of two). `None` where the ray surely misses the root within `t_min..=t_max`.
    pub fn new(ray: &ObjectRay, t_max: f32, root: &Bounds, scale: f64) -> Option<Self> {
        let t_min = ray.t_min();
        let (enter, leave) = root_interval(ray, t_max, root)?;
        let t_shift = t_shift(ray, enter, root);
        let (near_by, origin_bounds) = ray.origin_bounded();
        let (along, direction_bounds) = ray.direction_bounded();
        let mut out = Self {
            near_origin: [0.0; 3],
            far_origin: [0.0; 3],
            near_reciprocal: [f32::INFINITY; 3],
            far_reciprocal: [f32::INFINITY; 3],
            near_side: [0; 3],
            t_shift,
            t_min,
            near_floor: if t_shift == 0.0 { t_min } else { 0.0 },
        };
        let shift = f64::from(t_shift);
        for axis in 0..3 {
            let (d, d_bound) = (along[axis], direction_bounds[axis]);
            let moved = shift * d;
            let mut origin = near_by[axis] + moved;
            let mut bound = origin_bounds[axis];
            if shift != 0.0 {
                bound += shift * d_bound + (moved.abs() + origin.abs()) * (2.0 * U);
                bound *= 1.0 + 8.0 * U;
            }
            let parallel = is_parallel(d, d_bound);
            if parallel && d_bound != 0.0 {
                // |d t| over the stretch of t that is left.
                bound = (bound + (leave - shift) * (2.0 * d_bound)) * (1.0 + 8.0 * U);
            }
            if !(origin.is_finite() && bound.is_finite()) {
                (origin, bound) = (0.0, f64::INFINITY);
            }
            // Scaling is exact, the sums round: one ulp of f64 further out, then on to f32.
            let low = round_down(((origin - bound) * scale).next_down_unless(bound == 0.0));
            let high = round_up(((origin + bound) * scale).next_up_unless(bound == 0.0));
            let upwards = d > 0.0 || parallel;
            out.near_side[axis] = usize::from(!upwards);
            (out.near_origin[axis], out.far_origin[axis]) = if upwards { (high, low) } else { (low, high) };
            if parallel {
                continue;
            }
            // Largest and smallest magnitude of the scaled direction.
            let most = (d.abs() + d_bound) * scale;
            let least = (d.abs() - d_bound) * scale;
            // The sums and divisions in f64 err by 4u, far below the slack of 2^-22.
            let near = round_down(SHRINK / most);
            let far = round_up(WIDEN / least);
            (out.near_reciprocal[axis], out.far_reciprocal[axis]) =
                if upwards { (near, far) } else { (-near, -far) };
        }
        Some(out)
    }

    /// The limit for a largest t of interest (absolute, t >= 0): no hit whose rounded t is at most
    /// `t` has a near bound above it.
    pub fn limit(&self, t: f32) -> NodeLimit {
        // An infinite t would let boxes at infinity pass.
        let t = t.min(f32::MAX);
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

    /// A lower bound of the rounded t of any hit in the tree.
    pub fn root_entry(&self) -> f32 {
        self.absolute(self.near_floor)
    }
}

/// The stretch of t within the root box, rounded outwards and cut to `t_min..=t_max`.
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

/// Whether a direction's component may be zero, or is not known at all (NaN).
fn is_parallel(d: f64, d_bound: f64) -> bool {
    d.is_nan() || d.abs() <= d_bound
}

/// From where t is counted: 0 for a ray that starts near the box, else an f32 at or below `enter`.
fn t_shift(ray: &ObjectRay, enter: f64, root: &Bounds) -> f32 {
    let (origin, _) = ray.origin_bounded();
    let far_away = (0..3).any(|axis| {
        let size = f64::from(root.max[axis]).abs().max(f64::from(root.min[axis]).abs());
        origin[axis].abs() > 4.0 * size
    });
    // Below 2^-60 the sums of t would meet the subnormal numbers.
    if !far_away || enter < 1.0 / (1u64 << 60) as f64 {
        return 0.0;
    }
    round_down(enter)
}

/// The largest f32 not above x.
pub fn round_down(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// The smallest f32 not below x.
pub fn round_up(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x { near.next_up() } else { near }
}

/// A step outwards, but none where the number is exact.
trait Outwards {
    fn next_up_unless(self, exact: bool) -> Self;
    fn next_down_unless(self, exact: bool) -> Self;
}

impl Outwards for f64 {
    fn next_up_unless(self, exact: bool) -> Self {
        if exact { self } else { self.next_up() }
    }

    fn next_down_unless(self, exact: bool) -> Self {
        if exact { self } else { self.next_down() }
    }
}
