//! Four spheres.
//!
//! The line misses a ball where it is further from the centre than r: |D x m| > r |D|, m = o' - centre
//! (2-norms). With the f32 vectors and the table's bound for d x w,
//!
//! ```text
//! |E x M| > r |D| + |E| (e + c |M|)
//! ```
//!
//! proves it. Both sides are squared; the left side's own rounding, 4u, is within the margins.

use super::{ALL, BlockRay, LANES, Row, cross, dot, load, norm1, sub};
use crate::geometry::{Intersection, ObjectRay, Precision, sphere};
use crate::math::four::Four;

/// Up to four spheres.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Spheres {
    center: [Row; 3],
    radius: Row,
}

impl Spheres {
    /// None; a lane that is not set means nothing.
    pub const EMPTY: Self = Self { center: [[0.0; LANES]; 3], radius: [0.0; LANES] };

    /// Puts a sphere into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, center: [f32; 3], radius: f32) {
        for (row, x) in self.center.iter_mut().zip(center) {
            row[lane] = x;
        }
        self.radius[lane] = radius;
    }

    /// A bit for each lane that the ray's line does not surely miss.
    #[inline]
    pub fn met(&self, ray: &BlockRay) -> u32 {
        let m = sub(ray.origins(), load(&self.center));
        let q = cross(ray.directions(), m);
        let bound = Four::splat(ray.fixed) + Four::splat(ray.growing) * norm1(m);
        let room = Four::new(self.radius) * Four::splat(ray.length) + bound;
        ALL & !(dot(q, q).above(room * room))
    }

    /// Where a ray enters the sphere in a lane: [`sphere::intersect`].
    #[inline]
    pub fn intersect(&self, lane: usize, ray: &ObjectRay, precision: Precision) -> Option<Intersection> {
        let center = self.center.map(|row| row[lane]);
        sphere::intersect(ray, center, self.radius[lane], precision)
    }
}
