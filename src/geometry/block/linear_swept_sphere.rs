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
//! Where the difference of the left side and F is positive its square is compared with
//! r^2 |E x A|^2. Of the 12u in c the left side and E x A ask for 9u and 3u of their magnitudes; what is
//! left pays for the squares, at most 4u of r |E x A|.
//!
//! *Underflow:* |A| counts as 2^-40 longer, so that F has at least 2^-100 |A|, and 2^-62 r for roundings:
//! that outweighs r |E x A| where r^2 is lost, and r times the root of what the square of E x A can lose,
//! 2^-73; 2^-126 pays for the other products.

use super::{ALL, BlockRay, LANES, Row, load, norm1, sub};
use crate::geometry::{Intersection, ObjectRay, Precision, Surface, linear_swept_sphere};
use crate::math::ahead::fetch;
use crate::math::four::{Four, Fused};

/// Up to four linear swept spheres.
#[derive(Clone, Copy, Debug)]
pub struct LinearSweptSpheres {
    ends: SweptEnds,
    caps: [[bool; 2]; LANES],
}

/// Their ends alone: two lines of cache, where a ray that meets none reads nothing more.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct SweptEnds {
    positions: [[Row; 3]; 2],
    radii: [Row; 2],
}

impl LinearSweptSpheres {
    /// None; a lane that is not set means nothing.
    pub const EMPTY: Self = Self { ends: SweptEnds::EMPTY, caps: [[false; 2]; LANES] };

    /// Puts a swept sphere into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, positions: [[f32; 3]; 2], radii: [f32; 2], caps: [bool; 2]) {
        self.ends.set(lane, positions, radii);
        self.caps[lane] = caps;
    }

    /// [`SweptEnds::met`].
    #[inline]
    pub fn met<F: Fused>(&self, fused: F, ray: &BlockRay) -> u32 {
        self.ends.met(fused, ray)
    }

    /// [`SweptEnds::intersect`].
    #[inline]
    pub fn intersect(&self, lane: usize, ray: &ObjectRay, precision: Precision) -> Option<Intersection> {
        self.ends.intersect(lane, &self.caps, ray, precision)
    }
}

impl SweptEnds {
    /// None; a lane that is not set means nothing.
    pub const EMPTY: Self = Self { positions: [[[0.0; LANES]; 3]; 2], radii: [[0.0; LANES]; 2] };

    /// Has the processor bring it into its caches.
    #[inline(always)]
    pub fn fetch(&self) {
        fetch(self.positions.as_flattened().as_flattened());
        fetch(self.radii.as_flattened());
    }

    /// Puts the ends of a swept sphere into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, positions: [[f32; 3]; 2], radii: [f32; 2]) {
        for end in 0..2 {
            for (row, x) in self.positions[end].iter_mut().zip(positions[end]) {
                row[lane] = x;
            }
            self.radii[end][lane] = radii[end];
        }
    }

    /// A bit for each lane that the ray's line does not surely miss.
    #[inline(always)]
    pub fn met<F: Fused>(&self, fused: F, ray: &BlockRay) -> u32 {
        let p0 = load(&self.positions[0]);
        let axis = sub(load(&self.positions[1]), p0);
        let w = sub(ray.origins(), p0);
        let across = fused.fused_cross(ray.directions(), axis);
        let volume = fused.fused_dot(w, across);
        let radius = Four::new(self.radii[0]).greater(Four::new(self.radii[1]));
        let length = norm1(axis) + Four::splat(1.0 / 1_099_511_627_776.0);
        let apart = volume.abs() - length * Four::splat(ray.reach);
        // Written so that a NaN is not apart.
        let apart = apart.if_above(Four::ZERO);
        let square = fused.fused_dot(across, across);
        let room = fused.fused_sum(radius * radius, square, Four::splat(f32::MIN_POSITIVE));
        ALL & !((apart * apart).above(room))
    }

    /// Where a ray enters the swept sphere in a lane: [`linear_swept_sphere::intersect`]. `caps` are those
    /// of all lanes, and read only where one is entered: on a disabled one there is no candidate.
    #[inline(always)]
    pub fn intersect(
        &self,
        lane: usize,
        caps: &[[bool; 2]; LANES],
        ray: &ObjectRay,
        precision: Precision,
    ) -> Option<Intersection> {
        let [p0, p1] = &self.positions;
        let positions = [[p0[0][lane], p0[1][lane], p0[2][lane]], [p1[0][lane], p1[1][lane], p1[2][lane]]];
        let radii = [self.radii[0][lane], self.radii[1][lane]];
        let found = linear_swept_sphere::intersect(ray, positions, radii, [true; 2], precision)?;
        let is_disabled = match found.surface {
            Surface::Cap0 => !caps[lane][0],
            Surface::Cap1 => !caps[lane][1],
            _ => false,
        };
        (!is_disabled).then_some(found)
    }
}
