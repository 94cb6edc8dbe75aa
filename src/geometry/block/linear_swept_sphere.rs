//! Four linear swept spheres.
//!
//! A swept sphere lies within the capsule of its greater radius r about the axis' line. Two lines that
//! are not parallel have the distance |w.(D x A)| / |D x A|, w = o' - P0, A = P1 - P0 (for parallel ones
//! both sides vanish, which proves nothing). So |w.(D x A)| > r |D x A| proves a miss. By the table
//! the left side is off by at most |E| |A| (e + c |w|), and D x A by c |E| |A|:
//!
//! ```text
//! |W.(E x A)| > r |E x A| + F        F = |A| |E| (e + c (|W| + r))
//! ```
//!
//! and as (x + y)^2 <= (1 + η) x^2 + (1 + 1/η) y^2, here with η = 2^-6, no root is needed:
//!
//! ```text
//! (W.(E x A))^2 > (1 + 2^-6) r^2 |E x A|^2 + 65 F^2
//! ```
//!
//! *Underflow:* |A| counts as 2^-40 longer, so that F^2 has at least 2^-121 r^2, which outweighs
//! r^2 times what the square of E x A can lose, 2^-148; 2^-126 pays for the other squares.

use super::{ALL, BlockRay, LANES, Row, cross, dot, load, norm1, sub};
use crate::geometry::{Intersection, ObjectRay, Precision, linear_swept_sphere};
use crate::math::four::Four;

/// Up to four linear swept spheres.
#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
pub struct LinearSweptSpheres {
    positions: [[Row; 3]; 2],
    radii: [Row; 2],
    caps: [[bool; 2]; LANES],
}

impl LinearSweptSpheres {
    /// None; a lane that is not set means nothing.
    pub const EMPTY: Self =
        Self { positions: [[[0.0; LANES]; 3]; 2], radii: [[0.0; LANES]; 2], caps: [[false; 2]; LANES] };

    /// Puts a swept sphere into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, positions: [[f32; 3]; 2], radii: [f32; 2], caps: [bool; 2]) {
        for end in 0..2 {
            for (row, x) in self.positions[end].iter_mut().zip(positions[end]) {
                row[lane] = x;
            }
            self.radii[end][lane] = radii[end];
        }
        self.caps[lane] = caps;
    }

    /// A bit for each lane that the ray's line does not surely miss.
    #[inline]
    pub fn met(&self, ray: &BlockRay) -> u32 {
        let p0 = load(&self.positions[0]);
        let axis = sub(load(&self.positions[1]), p0);
        let w = sub(ray.origins(), p0);
        let across = cross(ray.directions(), axis);
        let volume = dot(w, across);
        let radius = Four::new(self.radii[0]).greater(Four::new(self.radii[1]));
        let far = norm1(w) + radius;
        let length = norm1(axis) + Four::splat(1.0 / 1_099_511_627_776.0);
        let bound = length * (Four::splat(ray.fixed) + Four::splat(ray.growing) * far);
        let room = Four::splat(1.0 + 1.0 / 63.0) * (radius * radius) * dot(across, across)
            + Four::splat(66.0) * (bound * bound)
            + Four::splat(f32::MIN_POSITIVE);
        ALL & !((volume * volume).above(room))
    }

    /// Where a ray enters the swept sphere in a lane: [`linear_swept_sphere::intersect`].
    #[inline]
    pub fn intersect(&self, lane: usize, ray: &ObjectRay, precision: Precision) -> Option<Intersection> {
        let positions = self.positions.map(|rows| rows.map(|row| row[lane]));
        let radii = self.radii.map(|row| row[lane]);
        linear_swept_sphere::intersect(ray, positions, radii, self.caps[lane], precision)
    }
}
