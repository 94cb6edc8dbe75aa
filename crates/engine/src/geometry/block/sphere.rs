//! Four spheres.
//!
//! The line misses a ball where it is further from the centre than r: |D x m| > r |D|, m = o' -
//! centre (2-norms). With the f32 vectors and the table's bound for d x w,
//!
//! ```text
//! |E x M| > r |D| + |E| (e + c |M|)
//! ```
//!
//! proves it. Both sides are squared; the left side's own rounding, 4u, is within the margins.
//!
//! Only the entry counts, which lies behind the origin where D.m > 0, be the origin inside or not.
//! By the table E.M > |E| (e + c |M|) proves that; it is asked for rays whose interval begins at 0
//! or later and whose origin was not moved.

use bytemuck::NoUninit;

use super::{ALL_LANES, CullRay, LANES, PerLane, load, sub};
use crate::geometry::{Intersection, Intersection4, ObjectRay, Precision, sphere};
use crate::math::f32x4::{F32x4, FmaOps};
use crate::math::f64x4::F64x4Ops;

/// Up to four spheres.
#[derive(Clone, Copy, Debug, NoUninit)]
#[repr(C, align(64))]
pub struct Sphere4 {
    center: [PerLane; 3],
    radius: PerLane,
}

impl Sphere4 {
    /// A block of no primitives; the results of lanes that are not set have no meaning.
    pub const EMPTY: Self = Self { center: [[0.0; LANES]; 3], radius: [0.0; LANES] };

    /// Stores a sphere into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, center: [f32; 3], radius: f32) {
        for (row, x) in self.center.iter_mut().zip(center) {
            row[lane] = x;
        }
        self.radius[lane] = radius;
    }

    /// A mask of the lanes that the line of the ray may hit.
    #[inline(always)]
    pub fn maybe_hit_mask<F: FmaOps>(&self, simd: F, ray: &CullRay) -> u32 {
        self.maybe_hit_mask_with(simd, ray, F32x4::splat(f32::INFINITY))
    }

    /// [`Self::maybe_hit_mask`] without the spheres that are certainly entered behind the origin,
    /// if t is never negative.
    #[inline(always)]
    pub fn maybe_entered_mask<F: FmaOps>(&self, simd: F, ray: &CullRay) -> u32 {
        self.maybe_hit_mask_with(simd, ray, F32x4::splat(ray.behind_error_bound))
    }

    #[inline(always)]
    fn maybe_hit_mask_with<F: FmaOps>(&self, simd: F, ray: &CullRay, behind: F32x4) -> u32 {
        let d = ray.directions();
        let m = sub(ray.origins(), load(&self.center));
        let q = simd.fma_cross(d, m);
        let threshold =
            simd.fma(F32x4::new(self.radius), F32x4::splat(ray.length), F32x4::splat(ray.error_bound));
        ALL_LANES & !(simd.fma_dot(q, q).cmp_gt(threshold * threshold) | simd.fma_dot(d, m).cmp_gt(behind))
    }

    /// The f64 filter for all lanes.
    #[inline(always)]
    pub fn intersect4<D: F64x4Ops>(&self, simd: D, ray: &ObjectRay, limit: f32) -> Intersection4 {
        sphere::intersect4(simd, ray, &self.center, &self.radius, limit)
    }

    /// Intersects the sphere in a lane: [`sphere::intersect`].
    #[inline(always)]
    pub fn intersect(&self, lane: usize, ray: &ObjectRay, precision: Precision) -> Option<Intersection> {
        let center = [self.center[0][lane], self.center[1][lane], self.center[2][lane]];
        sphere::intersect(ray, center, self.radius[lane], precision)
    }
}
