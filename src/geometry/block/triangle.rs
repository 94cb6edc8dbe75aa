//! Four triangles.
//!
//! Seen along the ray (Woop, Benthin and Wald, *Watertight Ray/Triangle Intersection*, 2013): with the
//! direction's greatest component along axis k, the vertex V becomes, relative to the origin, the point
//!
//! ```text
//! x' = (V_i - o_i) - s_i (V_k - o_k)        y' = (V_j - o_j) - s_j (V_k - o_k)        s = D / D_k
//! ```
//!
//! of the plane across the ray. The line misses the triangle where two of the edges' areas
//! A' x B', B' x C', C' x A' about the origin of that plane have opposite signs.
//!
//! # Error
//! Let z = |V_k - o_k| and n = |x'| + |y'| as computed. A difference rounds once (u) and has the origin's
//! error; the quotient s of E is off by 2 κ |E| and one rounding at most, |s| <= 1; the product and the
//! difference round once each. As |V_i - o_i| <= |x'| + z up to these errors, x' and y' together are off
//! by at most
//!
//! ```text
//! p = 2 e + (2 κ |E| + 12 u) (z + n)
//! ```
//!
//! (e counts once for i and j together and |s_i| + |s_j| <= 2 times for k, of which the 1-norm e holds
//! one share: 2 e bounds the sum; u of z: 2 for the differences, 2 for s and 2 for the products; u of n: 1 + 1
//! and what |V_i - o_i| adds, 1.) An area A'_x B'_y - A'_y B'_x is then off by p times the sum N of the three
//! vertices' n, by 2 p^2 at most and by its three roundings, 2u N^2 <= p N. So each is off by at most
//! 2 p (N + p), with z and n summed over the three vertices in p. Two areas of opposite signs beyond that
//! prove a miss.
//!
//! |E| >= 1, so that 2 |E| e bounds 2 e, and 2 |E| c bounds the other coefficient.

use super::{ALL, BlockRay, LANES, Row};
use crate::geometry::triangle;
use crate::geometry::{DoubleRay, FourTested, Intersection, ObjectRay, Precision};
use crate::math::ahead::fetch;
use crate::math::doubles::Doubles;
use crate::math::four::{Four, Fused};

/// Up to four triangles.
#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
pub struct Triangles {
    vertices: [[Row; 3]; 3],
}

impl Triangles {
    /// None; a lane that is not set means nothing.
    pub const EMPTY: Self = Self { vertices: [[[0.0; LANES]; 3]; 3] };

    /// Has the processor bring it into its caches.
    #[inline(always)]
    pub fn fetch(&self) {
        fetch(self.vertices.as_flattened().as_flattened());
    }

    /// Puts a triangle into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, vertices: [[f32; 3]; 3]) {
        for (rows, vertex) in self.vertices.iter_mut().zip(vertices) {
            for (row, x) in rows.iter_mut().zip(vertex) {
                row[lane] = x;
            }
        }
    }

    /// A bit for each lane that the ray's line does not surely miss.
    #[inline(always)]
    pub fn met<F: Fused>(&self, fused: F, ray: &BlockRay) -> u32 {
        let k = ray.axis;
        let (i, j) = ([1, 2, 0][k], [2, 0, 1][k]);
        let [oi, oj, ok] = [i, j, k].map(|axis| Four::splat(ray.origin[axis]));
        let [si, sj] = [i, j].map(|axis| Four::splat(ray.direction[axis] / ray.direction[k]));
        let seen = |vertex: &[Row; 3]| {
            let z = Four::new(vertex[k]) - ok;
            let x = (Four::new(vertex[i]) - oi) - si * z;
            let y = (Four::new(vertex[j]) - oj) - sj * z;
            (x, y, x.abs() + y.abs(), z.abs())
        };
        let (ax, ay, an, az) = seen(&self.vertices[0]);
        let (bx, by, bn, bz) = seen(&self.vertices[1]);
        let (cx, cy, cn, cz) = seen(&self.vertices[2]);
        let area = |x: Four, y: Four, u: Four, v: Four| fused.fused_difference(x, v, y * u);
        let areas = [area(ax, ay, bx, by), area(bx, by, cx, cy), area(cx, cy, ax, ay)];
        let least = areas[0].lesser(areas[1]).lesser(areas[2]);
        let most = areas[0].greater(areas[1]).greater(areas[2]);
        let n = an + bn + cn;
        let fixed = Four::splat(ray.fixed + ray.fixed);
        let growing = Four::splat(ray.growing + ray.growing);
        let p = fused.fused_sum(growing, n + (az + bz + cz), fixed);
        let error = (p + p) * (n + p);
        let zero = Four::splat(0.0);
        ALL & !((zero - error).above(least) & most.above(error))
    }

    /// The f64 step for all lanes.
    #[inline(always)]
    pub fn tested<D: Doubles>(&self, doubles: D, ray: &DoubleRay, limit: f32) -> FourTested {
        triangle::tested(doubles, ray, &self.vertices, limit)
    }

    /// Where a ray meets the triangle in a lane: [`triangle::intersect`].
    #[inline(always)]
    pub fn intersect(&self, lane: usize, ray: &ObjectRay, precision: Precision) -> Option<Intersection> {
        let [a, b, c] = &self.vertices;
        let vertices = [a, b, c].map(|rows| [rows[0][lane], rows[1][lane], rows[2][lane]]);
        triangle::intersect(ray, vertices, precision)
    }
}
