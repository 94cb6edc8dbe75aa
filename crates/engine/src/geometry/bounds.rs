//! Boxes around primitives and instances, rounded outwards so that no hit is ever lost.

use crate::math::array;
use crate::math::error_bound::{round_down, round_up};

/// An axis-parallel box. A side may be infinite where the shape leaves the range of `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The least coordinates.
    pub min: [f32; 3],
    /// The greatest coordinates.
    pub max: [f32; 3],
}

impl Bounds {
    /// The box that holds nothing: the neutral element of [`Bounds::union`].
    pub const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// The least box around points; empty for none. NaNs are ignored.
    pub fn of_points(points: &[[f32; 3]]) -> Self {
        let mut out = Self::EMPTY;
        for point in points {
            for (axis, &x) in point.iter().enumerate() {
                out.min[axis] = out.min[axis].min(x);
                out.max[axis] = out.max[axis].max(x);
            }
        }
        out
    }

    /// The box around a sphere of finite centre and radius, rounded outwards.
    #[inline]
    pub fn around(center: [f32; 3], radius: f32) -> Self {
        let radius = radius.abs();
        // One rounding to nearest each, undone by one step outwards.
        Self {
            min: array::map(center, |c| (c - radius).next_down()),
            max: array::map(center, |c| (c + radius).next_up()),
        }
    }

    /// The least box that holds both.
    #[must_use]
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        let mut out = *self;
        for axis in 0..3 {
            out.min[axis] = out.min[axis].min(other.min[axis]);
            out.max[axis] = out.max[axis].max(other.max[axis]);
        }
        out
    }

    /// The surface area. Of the boxes inside a convex box, a random line that hits that box hits on
    /// average as many as their areas are times its area (Cauchy, Crofton).
    pub fn surface(&self) -> f64 {
        let [x, y, z] = array::map([0, 1, 2], |axis| f64::from(self.max[axis]) - f64::from(self.min[axis]));
        2.0 * (x * y + y * z + z * x)
    }

    /// A box around this box's image under a row-major 3x4 matrix.
    ///
    /// Row i of the image spans b_i + sum_j of the interval a_ij [min_j, max_j]. A product of two
    /// f32 is exact in f64 and the three sums lose at most 3u (1 + O(u)) of the magnitudes' sum;
    /// 4u of it (2^-51) is taken away before rounding down and added before rounding up.
    #[must_use]
    pub fn transformed(&self, matrix: &[[f32; 4]; 3]) -> Self {
        let mut out = Self::EMPTY;
        for (i, row) in matrix.iter().enumerate() {
            let (mut low, mut high, mut magnitude) = (f64::from(row[3]), f64::from(row[3]), 0.0);
            magnitude += low.abs();
            for (j, &entry) in row[..3].iter().enumerate() {
                let a = f64::from(entry) * f64::from(self.min[j]);
                let b = f64::from(entry) * f64::from(self.max[j]);
                low += a.min(b);
                high += a.max(b);
                magnitude += a.abs().max(b.abs());
            }
            let slack = magnitude * 2f64.powi(-51);
            let (low, high) = (low - slack, high + slack);
            // 0 times an infinite side is a NaN: all that is known then is the whole line.
            out.min[i] = if low.is_nan() { f32::NEG_INFINITY } else { round_down(low) };
            out.max[i] = if high.is_nan() { f32::INFINITY } else { round_up(high) };
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_is_rounded_outwards() {
        // 1 + 2^-30 is no f32: the box must reach the next one.
        let b = Bounds::around([1.0, 0.0, 3e38], 2f32.powi(-30));
        assert!(b.max[0] == 1.0 + f32::EPSILON && b.min[0] < 1.0);
        assert_eq!(Bounds::around([3e38; 3], 3e38).max, [f32::INFINITY; 3]);
    }

    #[test]
    fn an_image_holds_the_corners() {
        // 90 degrees about z, scaled by 2 and moved: (x, y) -> (-2y + 1, 2x + 2).
        let matrix = [[0.0, -2.0, 0.0, 1.0], [2.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 0.0]];
        let b = Bounds { min: [0.0, 1.0, -1.0], max: [1.0, 3.0, 1.0] }.transformed(&matrix);
        let near = |x: f32, y: f32| x <= y && y - x <= 1e-6;
        assert!(near(b.min[0], -5.0) && near(b.min[1], 2.0) && near(b.min[2], -1.0), "{b:?}");
        assert!(near(-1.0, b.max[0]) && near(4.0, b.max[1]) && near(1.0, b.max[2]), "{b:?}");
    }

    #[test]
    fn an_infinite_side_stays_infinite() {
        let b = Bounds { min: [f32::NEG_INFINITY, 0.0, 0.0], max: [f32::INFINITY, 1.0, 1.0] };
        let b = b.transformed(&[[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
        assert_eq!((b.min[0], b.max[0]), (f32::NEG_INFINITY, f32::INFINITY));
    }
}
