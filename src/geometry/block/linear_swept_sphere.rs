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
//!
//! # The cone
//! That drops few of those which taper. With the axis P(v) = P0 + v A, the radius r(v) = r0 + v δ and X = D x A, the ray's line comes to P(v)
//! as near as
//!
//! ```text
//! dist^2 = V^2 / q + (v - N / q)^2 q / D.D          V = w.X     N = (D x w).X     q = X.X
//! ```
//!
//! (q is not 0; the line and the axis are nearest at v = N / q). It meets the ball at v where dist <= |r(v)|. The difference of both
//! squares is a quadratic in v, whose least value is not positive, for q > δ^2 D.D, where
//!
//! ```text
//! V^2 S <= R^2          S = q - δ^2 D.D     R = r0 q + δ N
//! ```
//!
//! so that V^2 S > R^2 and S > 0 prove a miss of the whole double cone.
//!
//! *Error.* Let L >= |A| (2-norms throughout), and ρ >= |E| (e + c x), x >= |w| + r: the bound for all primitives. By the table V is off by
//! at most |A| |E| (e + c |w|) <= L ρ, X by c |E| |A|, D x w by |E| (e + c |w|) <= ρ. The sums of three products round by 4u of their
//! magnitudes at most, a third of c of them. As |X| <= |E| |A|, |D x w| c <= ρ and, for c <= 0.1, c^2 <= 0.1 c,
//!
//! ```text
//! q    (2 c + c^2 + 0.4 c) |E|^2 |A|^2 <= 2.5 c |E|^2 L^2
//! N    ρ |X| + |D x w| c |E| |A| + ρ c |E| |A| + 0.4 ρ |E| |A| <= 2.5 ρ |E| L
//! ```
//!
//! And as c |E| r0 <= ρ and, where S > 0, |δ| <= |A|, with 2u for each product and sum of two and u for δ,
//!
//! ```text
//! R    2.5 c |E|^2 L^2 r0 + 2.5 ρ |E| L |δ| + 2u r0 q + 3u |δ N| <= 5.5 ρ |E| L^2
//! S    2.5 c |E|^2 L^2 + 5u |E|^2 L^2 <= 3 c |E|^2 L^2
//! ```
//!
//! V is taken L ρ nearer to 0, R 5.5 ρ |E| L^2 farther from it, and S 10 c |E|^2 L^2 less, so that nothing of it is left where
//! c > 0.1. 1e-5 pays for the roundings of the products that are compared.
//!
//! *Underflow:* L >= 2^-40, so that L ρ >= 2^-100, and L ρ >= 2^-60 |w|: both outweigh what V loses, as do the other
//! two what R and S lose. S is a difference of numbers of which one is at least 2^-99, so at least 2^-123 or 0: |V| S is subnormal
//! for |V| < 1 alone, and 2^-126 pays for what V S V and R^2 lose. *Overflow:* |V| S is multiplied by |V| then, so that an infinite
//! product is greater than any finite R^2 indeed.

use super::{ALL, CullRay, LANES, Row, load, norm1, sub};
use crate::geometry::{Intersection, ObjectRay, Precision, Surface, linear_swept_sphere};
use crate::math::f32x4::{F32x4, FmaOps};
use crate::math::prefetch::prefetch;

/// Up to four linear swept spheres without their caps: two lines of cache, where a ray that meets none reads nothing more.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct LinearSweptSphere4 {
    positions: [[Row; 3]; 2],
    radii: [Row; 2],
}

/// What both tests begin with, as at the head of this file.
struct Beside {
    /// W
    from_start: [F32x4; 3],
    /// E x A
    across: [F32x4; 3],
    /// Its square.
    square: F32x4,
    /// |A|, or more.
    length: F32x4,
    /// |W.(E x A)|, or less.
    apart: F32x4,
}

impl LinearSweptSphere4 {
    /// None; a lane that is not set means nothing.
    pub const EMPTY: Self = Self { positions: [[[0.0; LANES]; 3]; 2], radii: [[0.0; LANES]; 2] };

    /// Prefetches the block into the L1 cache.
    #[inline(always)]
    pub fn prefetch(&self) {
        prefetch(self.positions.as_flattened().as_flattened());
        prefetch(self.radii.as_flattened());
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

    /// A bit for each lane of which the ray's line does not surely miss the cylinder of its greater radius.
    #[inline(always)]
    pub fn maybe_hit_mask<F: FmaOps>(&self, simd: F, ray: &CullRay) -> u32 {
        let Beside { square, apart, .. } = self.beside(simd, ray);
        let radius = F32x4::new(self.radii[0]).relaxed_max(F32x4::new(self.radii[1]));
        let room = simd.fma(radius * radius, square, F32x4::splat(f32::MIN_POSITIVE));
        ALL & !((apart * apart).cmp_gt(room))
    }

    /// A bit for each lane of which the ray's line does not surely miss the cone: fewer, for half as many operations again. Pays for
    /// rays that go by themselves, whose next branches wait for it.
    #[inline(always)]
    pub fn maybe_hit_mask_tight<F: FmaOps>(&self, simd: F, ray: &CullRay) -> u32 {
        let Beside { from_start, across, square, length, apart } = self.beside(simd, ray);
        let [r0, r1] = self.radii.map(F32x4::new);
        let slope = r1 - r0;
        let area = length * length;
        let place = simd.fma_dot(simd.fma_cross(ray.directions(), from_start), across);
        let [wider, blur, steep] = ray.cone.map(F32x4::splat);
        let rest = square - simd.fma(area, blur, slope * slope * steep);
        let rest = rest.max(F32x4::ZERO);
        let radius = simd.fma(slope, place, r0 * square).abs();
        let radius = simd.fma(area, wider, radius);
        let room = simd.fma(radius * radius, F32x4::splat(1.0 + 1e-5), F32x4::splat(f32::MIN_POSITIVE));
        ALL & !((apart * rest * apart).cmp_gt(room))
    }

    /// Where the ray's line passes the axes' lines.
    #[inline(always)]
    fn beside<F: FmaOps>(&self, simd: F, ray: &CullRay) -> Beside {
        let p0 = load(&self.positions[0]);
        let axis = sub(load(&self.positions[1]), p0);
        let from_start = sub(ray.origins(), p0);
        let across = simd.fma_cross(ray.directions(), axis);
        let length = norm1(axis) + F32x4::splat(1.0 / 1_099_511_627_776.0);
        let apart = simd.fma_dot(from_start, across).abs() - length * F32x4::splat(ray.error_bound);
        // Written so that a NaN is not apart.
        let apart = apart.max(F32x4::ZERO);
        Beside { from_start, across, square: simd.fma_dot(across, across), length, apart }
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
