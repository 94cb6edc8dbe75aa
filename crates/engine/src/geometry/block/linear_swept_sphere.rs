//! Four linear swept spheres, and the f32 tests that cull them.
//!
//! With w = o' - P0, A = P1 - P0, r the greater radius and the ray's errors e, c and E of
//! `geometry::block`, the capsule around the shape is missed if
//!
//! ```text
//! |W.(E x A)| > r |E x A| + F        F = |A| |E| (e + c (|W| + r))
//! ```
//!
//! and the double cone around it, which matters if the radii differ, if V^2 S > R^2 and S > 0,
//! where
//!
//! ```text
//! X = D x A    V = w.X    N = (D x w).X    q = X.X    S = q - δ^2 D.D    R = r0 q + δ N
//! ```
//!
//! With L >= |A| and ρ >= |E| (e + c x), x >= |w| + r, V is off by at most L ρ, R by 5.5 ρ |E| L^2
//! and S by 3 c |E|^2 L^2, of which 10 c |E|^2 L^2 is taken. The derivation, underflow and overflow
//! included, is in `docs/derivations/cull-linear-swept-spheres.md`.

use bytemuck::NoUninit;

use super::{ALL_LANES, CullRay, LANES, PerLane, load, norm1, sub};
use crate::geometry::{Intersection, ObjectRay, Precision, Surface, linear_swept_sphere};
use crate::math::array;
use crate::math::f32x4::{F32x4, FmaOps};

/// Up to four linear swept spheres without their caps: two cache lines, all that a ray reads that
/// misses them.
#[derive(Clone, Copy, Debug, NoUninit)]
#[repr(C, align(64))]
pub struct LinearSweptSphere4 {
    positions: [[PerLane; 3]; 2],
    radii: [PerLane; 2],
}

/// The terms that both tests share, in the symbols of the module documentation.
struct SharedTerms {
    /// W, the vector from the first end to the origin.
    from_start: [F32x4; 3],
    /// E x A, the vector across the ray and the axis.
    cross: [F32x4; 3],
    /// The squared length of `cross`.
    cross2: F32x4,
    /// An upper bound of |A|.
    length: F32x4,
    /// A lower bound of |W.(E x A)|.
    separation: F32x4,
}

impl LinearSweptSphere4 {
    /// A block of no primitives; the results of lanes that are not set have no meaning.
    pub const EMPTY: Self = Self { positions: [[[0.0; LANES]; 3]; 2], radii: [[0.0; LANES]; 2] };

    /// Stores the ends of a swept sphere into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, positions: [[f32; 3]; 2], radii: [f32; 2]) {
        for end in 0..2 {
            for (row, x) in self.positions[end].iter_mut().zip(positions[end]) {
                row[lane] = x;
            }
            self.radii[end][lane] = radii[end];
        }
    }

    /// A mask of the lanes whose capsule of the greater radius the line of the ray may hit.
    #[inline(always)]
    pub fn maybe_hit_mask<F: FmaOps>(&self, simd: F, ray: &CullRay) -> u32 {
        let SharedTerms { cross2, separation, .. } = self.shared_terms(simd, ray);
        let radius = F32x4::new(self.radii[0]).relaxed_max(F32x4::new(self.radii[1]));
        let limit = simd.fma(radius * radius, cross2, F32x4::splat(f32::MIN_POSITIVE));
        ALL_LANES & !((separation * separation).cmp_gt(limit))
    }

    /// A mask of the lanes whose double cone, too, the line of the ray may hit: fewer lanes, for
    /// half as many operations again. This is worthwhile for single rays, whose next branches
    /// depend on it.
    #[inline(always)]
    pub fn maybe_hit_mask_tight<F: FmaOps>(&self, simd: F, ray: &CullRay) -> u32 {
        let SharedTerms { from_start, cross, cross2, length, separation } = self.shared_terms(simd, ray);
        let [r0, r1] = array::map(self.radii, F32x4::new);
        let slope = r1 - r0;
        let length2 = length * length;
        let n = simd.fma_dot(simd.fma_cross(ray.directions(), from_start), cross);
        let [r_error, s_error, direction2] = array::map(ray.cone_terms, F32x4::splat);
        let s = cross2 - simd.fma(length2, s_error, slope * slope * direction2);
        let s = s.max(F32x4::ZERO);
        let radius = simd.fma(slope, n, r0 * cross2).abs();
        let radius = simd.fma(length2, r_error, radius);
        let limit = simd.fma(radius * radius, F32x4::splat(1.0 + 1e-5), F32x4::splat(f32::MIN_POSITIVE));
        ALL_LANES & !((separation * s * separation).cmp_gt(limit))
    }

    /// Computes the terms of both tests.
    #[inline(always)]
    fn shared_terms<F: FmaOps>(&self, simd: F, ray: &CullRay) -> SharedTerms {
        let p0 = load(&self.positions[0]);
        let axis = sub(load(&self.positions[1]), p0);
        let from_start = sub(ray.origins(), p0);
        let cross = simd.fma_cross(ray.directions(), axis);
        let length = norm1(axis) + F32x4::splat(1.0 / 1_099_511_627_776.0);
        let separation = simd.fma_dot(from_start, cross).abs() - length * F32x4::splat(ray.error_bound);
        // Written so that a NaN becomes 0.
        let separation = separation.max(F32x4::ZERO);
        SharedTerms { from_start, cross, cross2: simd.fma_dot(cross, cross), length, separation }
    }

    /// Intersects the swept sphere in a lane: [`linear_swept_sphere::intersect`]. `caps`
    /// are those of all lanes, and read only where one is entered: on a disabled one there is no
    /// candidate.
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
