//! Four boxes.
//!
//! On one axis let the moved origin lie in [o-, o+] and the direction D in [d-, d+], d- > 0, and
//! let s count along D from o'. As boxes lie ahead of the moved origin or the ray starts there,
//! only s >= 0 matters, and a point with lo <= o + s D <= hi has
//!
//! ```text
//! (lo - o+) / d+  <=  s  <=  (hi - o-) / d-
//! ```
//!
//! (mirrored for d+ < 0). A difference rounds by u without changing its sign, a product by u; the
//! reciprocals are widened by 2^-20. A lane is missed where one axis' lower bound is above
//! another's upper one, or an upper one is below 0. An axis whose direction may be 0 does not
//! confine, unless it is exactly 0: then reciprocals are infinite and only the side of the origin
//! counts; a NaN (0 times infinity) confines nothing.

use bytemuck::NoUninit;

use super::{ALL_LANES, CullRay, LANES, PerLane};
use crate::geometry::Bounds;
use crate::geometry::{Intersection, ObjectRay, Precision, aabb};
use crate::math::array;
use crate::math::error_bound::{round_down, round_up};
use crate::math::f32x4::F32x4;

/// Up to four boxes.
#[derive(Clone, Copy, Debug, NoUninit)]
#[repr(C, align(16))]
pub struct Aabb4 {
    /// The minimum corners, then the maximum corners.
    corners: [[PerLane; 3]; 2],
}

/// A ray in f32 with widened slabs, prepared for the boxes of one BLAS.
#[derive(Clone, Copy, Debug)]
pub struct BoxRay {
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    near_reciprocal: [f32; 3],
    far_reciprocal: [f32; 3],
    /// For each axis the side that is entered first.
    near_side: [usize; 3],
}

impl BoxRay {
    /// Placeholder value, whose slabs are unbounded.
    pub const EMPTY: Self = Self {
        near_origin: [f32::NAN; 3],
        far_origin: [f32::NAN; 3],
        near_reciprocal: [0.0; 3],
        far_reciprocal: [0.0; 3],
        near_side: [0; 3],
    };

    /// Prepares a ray for boxes that lie within the given one (object space).
    pub fn new(object_ray: &ObjectRay, around: &Bounds) -> Self {
        let mut out = Self::EMPTY;
        let (ray, errors) = CullRay::prepare(object_ray, around);
        let Some(errors) = errors else { return out };
        let (origin_error, direction_error) = (errors.origin, errors.direction);
        // Points behind the moved origin would need the bounds mirrored.
        if f64::from(object_ray.t_min()) < 0.0 && errors.t0 == 0.0 {
            return out;
        }
        for i in 0..3 {
            let (o, d) = (f64::from(ray.origin[i]), f64::from(ray.direction[i]));
            let (least, most) = (d.abs() - direction_error[i], d.abs() + direction_error[i]);
            let (near, far) = if most == 0.0 {
                (f32::INFINITY, f32::INFINITY)
            } else if least > 0.0 {
                (round_down(SHRINK / most), round_up(WIDEN / least))
            } else {
                continue;
            };
            let below = round_down(o - origin_error[i] * WIDEN);
            let above = round_up(o + origin_error[i] * WIDEN);
            let upwards = d >= 0.0;
            out.near_side[i] = usize::from(!upwards);
            (out.near_origin[i], out.far_origin[i]) = if upwards { (above, below) } else { (below, above) };
            (out.near_reciprocal[i], out.far_reciprocal[i]) =
                if upwards { (near, far) } else { (-near, -far) };
        }
        out
    }
}

const SHRINK: f64 = 1.0 - 1.0 / 1_048_576.0;
const WIDEN: f64 = 1.0 + 1.0 / 1_048_576.0;

impl Aabb4 {
    /// A block of no primitives; the results of lanes that are not set have no meaning.
    pub const EMPTY: Self = Self { corners: [[[0.0; LANES]; 3]; 2] };

    /// Stores a box into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, min: [f32; 3], max: [f32; 3]) {
        for (rows, corner) in self.corners.iter_mut().zip([min, max]) {
            for (row, x) in rows.iter_mut().zip(corner) {
                row[lane] = x;
            }
        }
    }

    /// A mask of the lanes that the line of the ray may hit.
    #[inline]
    pub fn maybe_hit_mask(&self, slabs: &BoxRay) -> u32 {
        let mut near = F32x4::splat(0.0);
        let mut far = F32x4::splat(f32::INFINITY);
        for i in 0..3 {
            let side = slabs.near_side[i];
            let slab_t = |side: usize, origin: [f32; 3], reciprocal: [f32; 3]| {
                (F32x4::new(self.corners[side][i]) - F32x4::splat(origin[i])) * F32x4::splat(reciprocal[i])
            };
            let enter = slab_t(side, slabs.near_origin, slabs.near_reciprocal);
            let leave = slab_t(side ^ 1, slabs.far_origin, slabs.far_reciprocal);
            // Written so that a NaN keeps the old bound.
            near = enter.max(near);
            far = leave.min(far);
        }
        ALL_LANES & !(near.cmp_gt(far))
    }

    /// Intersects the box in a lane: [`aabb::intersect`].
    #[inline]
    pub fn intersect(&self, lane: usize, ray: &ObjectRay, precision: Precision) -> Option<Intersection> {
        let [min, max] = array::map(self.corners, |rows| array::map(rows, |row| row[lane]));
        aabb::intersect(ray, min, max, precision)
    }
}
