//! Four triangles, and the f32 test that culls them.
//!
//! Seen along the ray (Woop, Benthin and Wald, *Watertight Ray/Triangle Intersection*, 2013): with
//! the direction's greatest component along axis k, the vertex V becomes, relative to the origin,
//! the point
//!
//! ```text
//! x' = (V_i - o_i) - s_i (V_k - o_k)        y' = (V_j - o_j) - s_j (V_k - o_k)        s = D / D_k
//! ```
//!
//! of the plane across the ray. The line misses the triangle if two of the edges' areas A' x B', B'
//! x C', C' x A' about the origin of that plane have opposite signs, beyond their errors. With q^2
//! the sum of the squares of all x' and y', and r^2 that of all z = |V_k - o_k| besides, each area
//! is off by less than P (q + P),
//!
//! ```text
//! P = 10 e + 15 (3 ε / |E_k| + 12 u) r
//! ```
//!
//! where e bounds the error of the origin and ε that of the direction E (1-norms). The derivation
//! is in `docs/derivations/cull-triangles.md`.
//!
//! # Branches
//! On nearly every leaf the signs of the areas alone decide which triangles may be hit; that they
//! are certain is known some steps later. [`Triangle4::maybe_hit_mask`] checks the certainty in a
//! branch of its own, which is predicted well, so that nothing waits for it.

use bytemuck::NoUninit;

use super::{ALL_LANES, CullRay, LANES, MAX_COORDINATE, PerLane, TINY, UNIT, max_component, xyz0};
use crate::geometry::triangle;
use crate::geometry::{Bounds, DoubleRay, Intersection, Intersection4, ObjectRay, Precision, Ray, Verdict};
use crate::math::array;
use crate::math::f32x4::{F32x4, FmaOps};
use crate::math::f64x4::F64x4Ops;

/// A ray in f32 with error bounds, sheared onto its greatest axis, prepared for blocks of
/// triangles.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    /// The axes i, j and k; k is that of the greatest component of the direction.
    axes: [Axis; 3],
    /// The origin, in the order of `axes`.
    origin: [f32; 3],
    /// The components of -s on i and j.
    shear: [f32; 2],
    /// 10 e: the part of P that does not depend on the triangle.
    absolute_error: f32,
    /// 15 (3 ε / |E_k| + 12 u), or more.
    relative_error: f32,
}

/// An axis, as an enum as wide as an index: it needs neither a bounds check nor a conversion.
#[derive(Clone, Copy, Debug)]
#[repr(usize)]
enum Axis {
    X,
    Y,
    Z,
}

/// i, j and k for each k. A table, as branches would be mispredicted.
const AXES: [[Axis; 3]; 3] =
    [[Axis::Y, Axis::Z, Axis::X], [Axis::Z, Axis::X, Axis::Y], [Axis::X, Axis::Y, Axis::Z]];

impl ShearedRay {
    /// Placeholder value, which culls nothing.
    pub const EMPTY: Self = Self {
        axes: AXES[2],
        origin: [0.0; 3],
        shear: [0.0; 2],
        absolute_error: f32::INFINITY,
        relative_error: f32::INFINITY,
    };

    /// Whether [`ShearedRay::world_space`] is for triangles that lie within a box: no coordinate
    /// has a magnitude above 2^60.
    #[inline(always)]
    pub fn covers(around: &Bounds) -> bool {
        let size = xyz0(around.min).abs().relaxed_max(xyz0(around.max).abs());
        F32x4::splat(MAX_COORDINATE).cmp_ge(size) == ALL_LANES
    }

    /// A ray in world space, for triangles that it [covers](Self::covers). `None` where no
    /// component of its direction has a magnitude of 2^-60 or more, or any of direction and origin
    /// one above 2^60.
    #[inline(always)]
    pub fn world_space(ray: &Ray) -> Option<Self> {
        let (axis, most) = max_component(ray.direction);
        let within = |v: [f32; 3]| F32x4::splat(Ray::MAX_MAGNITUDE).cmp_ge(xyz0(v).abs());
        let fits = within(ray.origin) & within(ray.direction) == ALL_LANES && most >= Ray::MIN_MAGNITUDE;
        fits.then(|| Self::in_world_space(axis, ray))
    }

    /// A ray in world space that [is well scaled](Ray::is_well_scaled), so that nothing is checked.
    #[inline(always)]
    pub fn well_scaled(ray: &Ray) -> Self {
        let (axis, _) = max_component(ray.direction);
        Self::in_world_space(axis, ray)
    }

    /// ε is 0, and so is e but for what underflows. 13u is more than 12u.
    #[inline(always)]
    fn in_world_space(axis: usize, ray: &Ray) -> Self {
        Self::new(axis, &ray.origin, &ray.direction, 2.0 * TINY as f32, (13.0 * UNIT) as f32)
    }

    /// The sheared form of a ray with error bounds.
    #[inline(always)]
    pub fn of(ray: &CullRay) -> Self {
        // With its margins; written so that a NaN is not known well.
        let is_known = ray.relative_error <= 0.25;
        let absolute_error = if is_known { ray.absolute_error + ray.absolute_error } else { f32::INFINITY };
        Self::new(ray.axis, &ray.origin, &ray.direction, absolute_error, 3.0 * ray.relative_error)
    }

    #[inline(always)]
    fn new(
        axis: usize,
        origin: &[f32; 3],
        direction: &[f32; 3],
        absolute_error: f32,
        relative_error: f32,
    ) -> Self {
        let axes = AXES[axis];
        let [i, j, k] = array::map(axes, |axis| axis as usize);
        let inv_length = -1.0 / direction[k];
        Self {
            axes,
            origin: [origin[i], origin[j], origin[k]],
            shear: [direction[i] * inv_length, direction[j] * inv_length],
            absolute_error: 5.0 * absolute_error,
            relative_error: 15.0 * relative_error,
        }
    }

    /// A vertex of each lane, sheared so that the ray runs along the third axis from 0.
    #[inline(always)]
    fn shear<F: FmaOps>(&self, simd: F, vertex: &[PerLane; 3]) -> [F32x4; 3] {
        let [i, j, k] = [self.axes[0] as usize, self.axes[1] as usize, self.axes[2] as usize];
        let from_origin = |axis: usize, origin: f32| F32x4::new(vertex[axis]) - F32x4::splat(origin);
        let z = from_origin(k, self.origin[2]);
        let x = simd.fma(F32x4::splat(self.shear[0]), z, from_origin(i, self.origin[0]));
        let y = simd.fma(F32x4::splat(self.shear[1]), z, from_origin(j, self.origin[1]));
        [x, y, z]
    }
}

/// Up to four triangles.
#[derive(Clone, Copy, Debug, NoUninit)]
#[repr(C, align(16))]
pub struct Triangle4 {
    vertices: [[PerLane; 3]; 3],
}

impl Triangle4 {
    /// A block of no primitives; the results of lanes that are not set have no meaning.
    pub const EMPTY: Self = Self { vertices: [[[0.0; LANES]; 3]; 3] };

    /// Stores a triangle into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, vertices: [[f32; 3]; 3]) {
        for (rows, vertex) in self.vertices.iter_mut().zip(vertices) {
            for (row, x) in rows.iter_mut().zip(vertex) {
                row[lane] = x;
            }
        }
    }

    /// A mask of the lanes that the line of the ray may hit.
    #[inline(always)]
    pub fn maybe_hit_mask<F: FmaOps>(&self, simd: F, ray: &ShearedRay) -> u32 {
        let [a, b, c] = &self.vertices;
        let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) =
            (ray.shear(simd, a), ray.shear(simd, b), ray.shear(simd, c));
        let areas = [
            doubled_area(simd, [ax, ay], [bx, by]),
            doubled_area(simd, [bx, by], [cx, cy]),
            doubled_area(simd, [cx, cy], [ax, ay]),
        ];
        let least = areas[0].relaxed_min(areas[1]).relaxed_min(areas[2]);
        let most = areas[0].relaxed_max(areas[1]).relaxed_max(areas[2]);
        let zero = F32x4::ZERO;
        let maybe_hit = least.cmp_ge(zero) | zero.cmp_ge(most);

        let across = sum_of_squares(simd, ax, bx, cx) + sum_of_squares(simd, ay, by, cy);
        let around = across + sum_of_squares(simd, az, bz, cz);
        let p = simd.fma(F32x4::splat(ray.relative_error), around.sqrt(), F32x4::splat(ray.absolute_error));
        let missed = most.relaxed_min(zero - least).cmp_gt(p * (across.sqrt() + p));
        if maybe_hit | missed != ALL_LANES {
            return all_but(missed);
        }
        maybe_hit
    }

    /// The vertices of the triangle in a lane.
    #[inline(always)]
    fn vertices(&self, lane: usize) -> [[f32; 3]; 3] {
        let [a, b, c] = &self.vertices;
        let vertex = |[x, y, z]: &[PerLane; 3]| [x[lane], y[lane], z[lane]];
        [vertex(a), vertex(b), vertex(c)]
    }

    /// The f64 filter for one lane.
    #[inline(always)]
    pub fn intersect_simd<D: F64x4Ops>(
        &self,
        simd: D,
        lane: usize,
        ray: &DoubleRay<D>,
    ) -> Verdict<Intersection> {
        triangle::intersect_simd(simd, ray, self.vertices(lane))
    }

    /// The f64 filter for all lanes.
    #[inline(always)]
    pub fn intersect4<D: F64x4Ops>(&self, simd: D, ray: &DoubleRay<D>, limit: f32) -> Intersection4 {
        triangle::intersect4(simd, ray, &self.vertices, limit)
    }

    /// Intersects the triangle in a lane: [`triangle::intersect`].
    #[inline(always)]
    pub fn intersect(&self, lane: usize, ray: &ObjectRay, precision: Precision) -> Option<Intersection> {
        triangle::intersect(ray, self.vertices(lane), precision)
    }
}

/// Twice the signed area of the triangle between the origin and two points.
#[inline(always)]
fn doubled_area<F: FmaOps>(simd: F, [x, y]: [F32x4; 2], [u, v]: [F32x4; 2]) -> F32x4 {
    simd.fms(x, v, y * u)
}

#[inline(always)]
fn sum_of_squares<F: FmaOps>(simd: F, x: F32x4, y: F32x4, z: F32x4) -> F32x4 {
    simd.fma(x, x, simd.fma(y, y, z * z))
}

/// The mask of all lanes but some. It is not inlined, so that its call is a branch.
#[cold]
#[inline(never)]
fn all_but(missed: u32) -> u32 {
    ALL_LANES & !missed
}
