//! Motion (`VK_NV_ray_tracing_motion_blur`): the transforms and vertices at the time of a ray.
//!
//! # Definition
//! Two keys are given, at time 0 and at time 1. A number of a vertex or of a matrix is at time t
//! the `f32` nearest to the real number (1 - t) a + t b, ties to even: [`interpolate`]. So it is a
//! at 0 and b at 1, always between both, and everything after it (the exact inverse, the exact
//! intersection) works on `f32` as for things at rest.
//!
//! Of `VkSRTDataNV` each of the sixteen numbers is interpolated, as a real number. The quaternion q
//! of the interpolated ones stands for the rotation around its normalised axis: with N = |q|^2,
//!
//! ```text
//!            | ww+xx-yy-zz   2(xy-wz)      2(xz+wy)    |
//! R = 1/N *  | 2(xy+wz)      ww-xx+yy-zz   2(yz-wx)    |
//!            | 2(xz-wy)      2(yz+wx)      ww-xx-yy+zz |
//! ```
//!
//! The matrix is T x R x S, with S = [sx a b pvx; 0 sy c pvy; 0 0 sz pvz]. Its entries are
//! quotients of polynomials of the inputs by N, each rounded once to the nearest `f32`: in f64
//! where a bound allows, by exact arithmetic otherwise. The interpolation never chooses the shorter
//! arc: q and -q are different keys. Where the interpolated q is 0 there is no rotation, and no ray
//! hits the instance.

use crate::accel::transform::{IDENTITY, round_sum};
use crate::math::array;
use crate::math::error_bound::{product_error, quotient_error, two_units};
use crate::math::exact::Dyadic;
use crate::math::surd::Surd;

/// A row-major 3x4 matrix (`VkTransformMatrixKHR`).
pub type Matrix = [[f32; 4]; 3];

/// How an instance moves while time goes from 0 to 1.
#[derive(Clone, Debug, PartialEq)]
#[must_use]
#[non_exhaustive]
pub enum Motion {
    /// `VkAccelerationStructureMatrixMotionInstanceNV`: its transform at time 0 and at time 1.
    Matrix([Matrix; 2]),
    /// `VkAccelerationStructureSRTMotionInstanceNV`: a decomposed transform at time 0 and at time
    /// 1.
    Srt(Box<[Srt; 2]>),
}

impl Motion {
    /// Object to world at a time. `None` outside of 0 to 1, and where the interpolated quaternion
    /// is 0.
    #[must_use]
    pub fn at(&self, time: f32) -> Option<Matrix> {
        if !(0.0..=1.0).contains(&time) {
            return None;
        }
        match self {
            Self::Matrix([first, second]) => Some(std::array::from_fn(|row| {
                std::array::from_fn(|column| interpolate(first[row][column], second[row][column], time))
            })),
            Self::Srt(keys) => srt_at(keys, time),
        }
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let finite = |numbers: &[f32]| numbers.iter().all(|x| x.is_finite());
        match self {
            Self::Matrix(keys) => finite(keys.as_flattened().as_flattened()),
            Self::Srt(keys) => keys.iter().all(|key| finite(&key.numbers())),
        }
    }
}

/// A transform decomposed into scale, shear and pivot, then a rotation, then a translation
/// (`VkSRTDataNV`).
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Srt {
    /// `sx`, `sy`, `sz`
    pub scale: [f32; 3],
    /// `a`, `b`, `c`: y and z into x, then z into y.
    pub shear: [f32; 3],
    /// `pvx`, `pvy`, `pvz`: added before the rotation.
    pub pivot: [f32; 3],
    /// `qx`, `qy`, `qz`, `qw`
    pub quaternion: [f32; 4],
    /// `tx`, `ty`, `tz`: added after the rotation.
    pub translation: [f32; 3],
}

impl Default for Srt {
    /// The identity.
    fn default() -> Self {
        Self {
            scale: [1.0; 3],
            shear: [0.0; 3],
            pivot: [0.0; 3],
            quaternion: [0.0, 0.0, 0.0, 1.0],
            translation: [0.0; 3],
        }
    }
}

impl Srt {
    /// Its numbers in the order of `VkSRTDataNV`.
    #[must_use]
    pub fn numbers(&self) -> [f32; 16] {
        let ([sx, sy, sz], [a, b, c]) = (self.scale, self.shear);
        let ([pvx, pvy, pvz], [qx, qy, qz, qw]) = (self.pivot, self.quaternion);
        let [tx, ty, tz] = self.translation;
        [sx, a, b, pvx, sy, c, pvy, sz, pvz, qx, qy, qz, qw, tx, ty, tz]
    }
}

/// Where the numbers of `VkSRTDataNV` stand in S; `None` is a 0.
pub(super) const S: [[Option<usize>; 4]; 3] =
    [[Some(0), Some(1), Some(2), Some(3)], [None, Some(4), Some(5), Some(6)], [None, None, Some(7), Some(8)]];
/// Where the quaternion begins.
pub(super) const Q: usize = 9;
/// Where the translation begins.
pub(super) const T: usize = 13;

/// The `f32` nearest to (1 - t) a + t b. Both must be finite, t within 0 and 1.
#[inline]
pub fn interpolate(a: f32, b: f32, t: f32) -> f32 {
    // The products are exact in f64.
    let moved = |x: f32| f64::from(t) * f64::from(x);
    round_sum([f64::from(a), -moved(a), moved(b), 0.0])
}

/// A transform's matrix, or the identity where there is none at this time: what a shader would
/// read.
pub(super) fn or_identity(matrix: Option<Matrix>) -> Matrix {
    matrix.unwrap_or(IDENTITY)
}

/// The arithmetic that the formulas at the head of this file need.
trait Number: Clone {
    fn lerp(a: f32, b: f32, t: f32) -> Self;
    fn plus(&self, other: &Self) -> Self;
    fn minus(&self, other: &Self) -> Self;
    fn times(&self, other: &Self) -> Self;
}

/// A number in f64 that is off by at most `error`.
#[derive(Clone, Copy)]
struct BoundedF64 {
    value: f64,
    error: f64,
}

impl BoundedF64 {
    fn sum(self, value: f64, other: Self) -> Self {
        Self { value, error: self.error + other.error + two_units::<f64>() * value.abs() }
    }
}

impl Number for BoundedF64 {
    fn lerp(a: f32, b: f32, t: f32) -> Self {
        let (a, b, t) = (f64::from(a), f64::from(b), f64::from(t));
        // Two sums, each off by at most u times |a| + |b|.
        let magnitude = a.abs() + b.abs();
        Self { value: a - t * a + t * b, error: 2.0 * two_units::<f64>() * magnitude }
    }

    fn plus(&self, other: &Self) -> Self {
        self.sum(self.value + other.value, *other)
    }

    fn minus(&self, other: &Self) -> Self {
        self.sum(self.value - other.value, *other)
    }

    fn times(&self, other: &Self) -> Self {
        let error = product_error(self.value.abs(), self.error, other.value.abs(), other.error);
        Self { value: self.value * other.value, error }
    }
}

impl Number for Dyadic {
    fn lerp(a: f32, b: f32, t: f32) -> Self {
        let (a, b, t) = (Self::from_f32(a), Self::from_f32(b), Self::from_f32(t));
        &a + &(&t * &(&b - &a))
    }

    fn plus(&self, other: &Self) -> Self {
        self + other
    }

    fn minus(&self, other: &Self) -> Self {
        self - other
    }

    fn times(&self, other: &Self) -> Self {
        self * other
    }
}

/// N R of a quaternion, and N, as the head of this file defines them.
fn rotation<N: Number>([x, y, z, w]: [&N; 4]) -> ([[N; 3]; 3], N) {
    let double = |n: N| n.plus(&n);
    let [xx, yy, zz, ww] = [x, y, z, w].map(|n| n.times(n));
    let sum = |a: &N, b: &N, c: &N, d: &N| double(a.times(b).plus(&c.times(d)));
    let difference = |a: &N, b: &N, c: &N, d: &N| double(a.times(b).minus(&c.times(d)));
    let matrix = [
        [ww.plus(&xx).minus(&yy).minus(&zz), difference(x, y, w, z), sum(x, z, w, y)],
        [sum(x, y, w, z), ww.minus(&xx).plus(&yy).minus(&zz), difference(y, z, w, x)],
        [difference(x, z, w, y), sum(y, z, w, x), ww.minus(&xx).minus(&yy).plus(&zz)],
    ];
    (matrix, xx.plus(&yy).plus(&zz).plus(&ww))
}

/// N times an entry of T x R x S.
fn entry<N: Number>(
    numbers: &[N; 16],
    scaled_rotation: &[[N; 3]; 3],
    norm: &N,
    row: usize,
    column: usize,
) -> N {
    // S is upper triangular: its column has a number in every row down to the diagonal.
    let rest = (0..3).filter_map(|k| S[k][column].map(|at| scaled_rotation[row][k].times(&numbers[at])));
    let moved = (column == 3).then(|| numbers[T + row].times(norm));
    let sum = rest.chain(moved).reduce(|sum, term| sum.plus(&term));
    sum.expect("bug in anyhit: a column of S without a number")
}

fn srt_at(keys: &[Srt; 2], time: f32) -> Option<Matrix> {
    let [first, second] = [keys[0].numbers(), keys[1].numbers()];
    let near: [BoundedF64; 16] = std::array::from_fn(|at| BoundedF64::lerp(first[at], second[at], time));
    let (scaled_rotation, norm) = rotation(std::array::from_fn(|at| &near[Q + at]));
    // Computed only if one of the twelve entries needs it.
    let mut exact = None;
    let mut matrix = IDENTITY;
    for (row, entries) in matrix.iter_mut().enumerate() {
        for (column, to) in entries.iter_mut().enumerate() {
            let BoundedF64 { value, error } = entry(&near, &scaled_rotation, &norm, row, column);
            let quotient = value / norm.value;
            let error = quotient_error(quotient, error, norm.value, norm.error);
            let [below, above] = array::map([quotient - error, quotient + error], |x| x as f32 + 0.0);
            *to = if below == above {
                below
            } else {
                let (numbers, scaled_rotation, norm) = exact.get_or_insert_with(|| {
                    let numbers: [Dyadic; 16] =
                        std::array::from_fn(|at| Dyadic::lerp(first[at], second[at], time));
                    let (scaled_rotation, norm) = rotation(std::array::from_fn(|at| &numbers[Q + at]));
                    (numbers, scaled_rotation, norm)
                });
                if norm.is_zero() {
                    return None;
                }
                Surd::ratio(entry(numbers, scaled_rotation, norm, row, column), norm.clone()).to_f32()
            };
        }
    }
    Some(matrix)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_number_between_two_keys_is_rounded_once() {
        assert_eq!(interpolate(3.0, 5.0, 0.0), 3.0);
        assert_eq!(interpolate(3.0, 5.0, 1.0), 5.0);
        assert_eq!(interpolate(3.0, 5.0, 0.25), 3.5);
        let t = 2f32.powi(-24);
        assert_eq!(interpolate(1.0, 2.0, t), 1.0, "1 + 2^-24 is half way: to even");
        assert_eq!(interpolate(1.0, 3.0, t), 1.0 + f32::EPSILON);
        assert_eq!(interpolate(f32::MAX, f32::MAX, 0.3), f32::MAX);
        assert_eq!(interpolate(f32::MAX, -f32::MAX, 0.5), 0.0);
    }

    #[test]
    fn a_turn_by_two_right_angles_goes_the_way_of_its_quaternions() {
        // About z by 0 and by 180 degrees: half way, (0, 0, 1/2, 1/2) normalised is a right angle.
        let half = |quaternion| Srt { quaternion, ..Srt::default() };
        let keys = [half([0.0, 0.0, 0.0, 1.0]), half([0.0, 0.0, 1.0, 0.0])];
        let motion = Motion::Srt(Box::new(keys));
        let right_angle = [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        assert_eq!(motion.at(0.5), Some(right_angle));
        assert_eq!(motion.at(0.0), Some(IDENTITY));
        // tan(angle / 2) = (t / (1 - t)): at 1/4 the cosine is (9 - 1) / (9 + 1), the sine 6 / 10.
        let quarter = motion.at(0.25).expect("a rotation");
        assert_eq!([quarter[0][0], quarter[1][0]], [0.8, 0.6]);
        for outside in [-0.5, 1.5, f32::NAN] {
            assert_eq!(motion.at(outside), None);
        }
        // q and -q: the middle is 0.
        let keys = [half([0.0, 0.0, 0.0, 1.0]), half([0.0, 0.0, 0.0, -1.0])];
        assert_eq!(Motion::Srt(Box::new(keys)).at(0.5), None);
    }

    #[test]
    fn scale_shear_and_pivot_come_before_the_rotation_and_translation_after() {
        let key = Srt {
            scale: [2.0, 3.0, 4.0],
            shear: [0.5, 0.25, 0.125],
            pivot: [10.0, 20.0, 30.0],
            // A right angle about z, of length 2.
            quaternion: [0.0, 0.0, 2.0, 2.0],
            translation: [1.0, 2.0, 3.0],
        };
        // S = [2 .5 .25 10; 0 3 .125 20; 0 0 4 30]; the rotation takes (x, y, z) to (-y, x, z).
        let expected = [[0.0, -3.0, -0.125, -19.0], [2.0, 0.5, 0.25, 12.0], [0.0, 0.0, 4.0, 33.0]];
        assert_eq!(Motion::Srt(Box::new([key, key])).at(0.7), Some(expected));
    }

    fn srt() -> impl Strategy<Value = Srt> {
        prop::array::uniform16(-4.0f32..4.0).prop_map(|n| Srt {
            scale: [n[0], n[1], n[2]],
            shear: [n[3], n[4], n[5]],
            pivot: [n[6], n[7], n[8]],
            quaternion: [n[9], n[10], n[11], n[12]],
            translation: [n[13], n[14], n[15]],
        })
    }

    proptest! {
        /// Against the same polynomials in exact arithmetic alone.
        #[test]
        fn every_entry_is_the_nearest(first in srt(), second in srt(), time in 0.0f32..=1.0) {
            let motion = Motion::Srt(Box::new([first, second]));
            let matrix = motion.at(time).expect("no zero quaternion");
            let (a, b) = (first.numbers(), second.numbers());
            let numbers: [Dyadic; 16] = std::array::from_fn(|at| Dyadic::lerp(a[at], b[at], time));
            let (scaled_rotation, norm) = rotation(std::array::from_fn(|at| &numbers[Q + at]));
            for (row, entries) in matrix.iter().enumerate() {
                for (column, ours) in entries.iter().enumerate() {
                    let exact = Surd::ratio(entry(&numbers, &scaled_rotation, &norm, row, column), norm.clone());
                    prop_assert_eq!(*ours, exact.to_f32());
                }
            }
        }
    }
}
