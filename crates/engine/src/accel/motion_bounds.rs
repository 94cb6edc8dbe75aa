//! Boxes around instances that move: one box for all times.
//!
//! **Matrix motion.** Before rounding, the image of a point is (1 - t) A x + t B x: it lies on the
//! segment between its images at both ends, so within the union of their boxes.
//!
//! **SRT motion.** v = S(t) x runs on a segment too; R(t) v is no line. Time is cut into
//! [`TIME_INTERVALS`] intervals. In each, every number of the decomposition lies between its values
//! at the interval's ends, as it is linear in t; interval arithmetic with these ranges gives a
//! range of N = |q|^2, of the entries of R = (N R) / N, of v and of R v + T. Ranges forget that the
//! entries of R belong together, so two facts are added: an entry of a rotation lies within [-1,
//! 1], and |R v| = |v| (the components of R v are no longer than the longest v in the range). Where
//! N's range reaches 0 these two are all that is known. A bound for each operation's rounding in
//! f64 comes with each operation: one step outwards.
//!
//! **Rounding.** The traversal uses matrices whose entries are rounded to `f32`: entry m is off by
//! at most 2^-24 |m|, or 2^-150. Row i of the image is therefore off by at most 2^-24 sum_j |m_ij|
//! |x_j| + 2^-150 sum_j (|x_j| + 1); twice that is added on each side. For SRT, |m_ij| is at most
//! the length of column j of S, the greatest of its two keys', as a rotation keeps it.

use crate::accel::motion::{Matrix, Motion, Q, S, Srt, T};
use crate::geometry::Bounds;
use crate::math::array;
use crate::math::error_bound::{round_down, round_up};

/// The number of intervals into which time is divided.
const TIME_INTERVALS: u32 = 16;

/// The box around the images of a box at all times.
pub(super) fn bounds(around: &Bounds, motion: &Motion) -> Bounds {
    match motion {
        Motion::Matrix(keys) => matrix_bounds(around, keys),
        Motion::Srt(keys) => srt_bounds(around, keys),
    }
}

/// The greatest |x_j| in a box, then 1 for the translation.
fn max_abs(around: &Bounds) -> [f64; 4] {
    let side = |axis: usize| f64::from(around.min[axis].abs().max(around.max[axis].abs()));
    [side(0), side(1), side(2), 1.0]
}

/// Twice what rounding a row's entries of at most these magnitudes moves an image by.
fn slack(magnitudes: [f64; 4], max_abs: [f64; 4]) -> f64 {
    let row: f64 = magnitudes.iter().zip(max_abs).map(|(m, x)| m * x).sum();
    let rest: f64 = max_abs.iter().map(|x| x + 1.0).sum();
    2f64.powi(-23) * row + 2f64.powi(-149) * rest
}

fn matrix_bounds(around: &Bounds, keys: &[Matrix; 2]) -> Bounds {
    let ends = around.transformed(&keys[0]).union(&around.transformed(&keys[1]));
    let max_abs = max_abs(around);
    widened(&ends, |row| {
        let magnitude = |column: usize| f64::from(keys[0][row][column].abs().max(keys[1][row][column].abs()));
        slack(array::from_fn(magnitude), max_abs)
    })
}

fn widened(bounds: &Bounds, by: impl Fn(usize) -> f64) -> Bounds {
    // 0 times an infinite coordinate is a NaN: all that is known then is the whole line.
    let side = |value: f32, by: f64, infinite: f32| {
        let moved = f64::from(value) + by;
        if moved.is_nan() { f64::from(infinite) } else { moved }
    };
    Bounds {
        min: array::from_fn(|i| round_down(side(bounds.min[i], -by(i), f32::NEG_INFINITY))),
        max: array::from_fn(|i| round_up(side(bounds.max[i], by(i), f32::INFINITY))),
    }
}

/// The interval from `low` to `high`.
#[derive(Clone, Copy, Debug, Default)]
struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    fn of(a: f64, b: f64) -> Self {
        Self { low: a.min(b), high: a.max(b) }
    }

    fn outwards(self) -> Self {
        Self { low: self.low.next_down(), high: self.high.next_up() }
    }

    fn plus(self, other: Self) -> Self {
        Self { low: self.low + other.low, high: self.high + other.high }.outwards()
    }

    fn minus(self, other: Self) -> Self {
        Self { low: self.low - other.high, high: self.high - other.low }.outwards()
    }

    fn times(self, other: Self) -> Self {
        let ends =
            [self.low * other.low, self.low * other.high, self.high * other.low, self.high * other.high];
        let low = ends.into_iter().fold(f64::INFINITY, f64::min);
        let high = ends.into_iter().fold(f64::NEG_INFINITY, f64::max);
        Self { low, high }.outwards()
    }

    fn square(self) -> Self {
        let all = self.times(self);
        let low = if self.low <= 0.0 && self.high >= 0.0 { 0.0 } else { all.low.max(0.0) };
        Self { low, high: all.high }
    }

    fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    fn clamped(self, most: f64) -> Self {
        Self { low: self.low.max(-most), high: self.high.min(most) }
    }
}

fn srt_bounds(around: &Bounds, keys: &[Srt; 2]) -> Bounds {
    let whole = Bounds { min: [f32::NEG_INFINITY; 3], max: [f32::INFINITY; 3] };
    if !around.min.iter().chain(&around.max).all(|side| side.is_finite()) {
        return whole;
    }
    let numbers = [keys[0].numbers(), keys[1].numbers()];
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for interval in 0..TIME_INTERVALS {
        let ends = array::map([interval, interval + 1], |at| f64::from(at) / f64::from(TIME_INTERVALS));
        let ranges: [Interval; 16] = array::from_fn(|at| {
            let [a, b] = array::map([numbers[0][at], numbers[1][at]], f64::from);
            // Two roundings of sums of at most |a| + |b|.
            let slack = (a.abs() + b.abs()) * 2f64.powi(-50);
            let range = Interval::of(a - ends[0] * a + ends[0] * b, a - ends[1] * a + ends[1] * b);
            Interval { low: range.low - slack, high: range.high + slack }
        });
        for (row, image) in images(around, &ranges).into_iter().enumerate() {
            low[row] = low[row].min(image.low);
            high[row] = high[row].max(image.high);
        }
    }
    let columns: [f64; 4] = array::from_fn(|column| {
        let entries = S.iter().filter_map(|row| row[column]);
        let squares = entries.map(|at| f64::from(numbers[0][at].abs().max(numbers[1][at].abs())).powi(2));
        squares.sum::<f64>().sqrt()
    });
    let max_abs = max_abs(around);
    let by = |row: usize| {
        let moved = f64::from(numbers[0][T + row].abs().max(numbers[1][T + row].abs()));
        slack([columns[0], columns[1], columns[2], columns[3] + moved], max_abs)
    };
    Bounds {
        min: array::from_fn(|row| round_down(low[row] - by(row))),
        max: array::from_fn(|row| round_up(high[row] + by(row))),
    }
}

/// R S x + T for all x of a box and all numbers of the ranges.
fn images(around: &Bounds, ranges: &[Interval; 16]) -> [Interval; 3] {
    let scaled: [Interval; 3] = array::from_fn(|k| {
        let sides = (0..3).filter_map(|j| {
            let side = Interval::of(around.min[j].into(), around.max[j].into());
            S[k][j].map(|at| ranges[at].times(side))
        });
        let pivot = S[k][3].map(|at| ranges[at]);
        sides.chain(pivot).reduce(Interval::plus).expect("bug in anyhit: a row of S without a number")
    });
    let length = scaled.iter().map(|v| v.magnitude().powi(2)).sum::<f64>().sqrt();
    let length = length * (1.0 + 2f64.powi(-48));
    let [x, y, z, w] = array::map([0, 1, 2, 3], |at| ranges[Q + at]);
    let [xx, yy, zz, ww] = array::map([x, y, z, w], Interval::square);
    let norm = xx.plus(yy).plus(zz).plus(ww);
    let double = |range: Interval| range.plus(range);
    let sum = |a: Interval, b: Interval, c: Interval, d: Interval| double(a.times(b).plus(c.times(d)));
    let difference =
        |a: Interval, b: Interval, c: Interval, d: Interval| double(a.times(b).minus(c.times(d)));
    let scaled_rotation = [
        [ww.plus(xx).minus(yy).minus(zz), difference(x, y, w, z), sum(x, z, w, y)],
        [sum(x, y, w, z), ww.minus(xx).plus(yy).minus(zz), difference(y, z, w, x)],
        [difference(x, z, w, y), sum(y, z, w, x), ww.minus(xx).minus(yy).plus(zz)],
    ];
    let entry = |range: Interval| {
        if norm.low > 0.0 {
            let inverse = Interval { low: 1.0 / norm.high, high: 1.0 / norm.low }.outwards();
            range.times(inverse).clamped(1.0)
        } else {
            Interval { low: -1.0, high: 1.0 }
        }
    };
    array::from_fn(|row| {
        let terms = (0..3).map(|k| entry(scaled_rotation[row][k]).times(scaled[k]));
        let image = terms.reduce(Interval::plus).expect("bug in anyhit: the sum has no terms");
        image.clamped(length).plus(ranges[T + row])
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn key() -> impl Strategy<Value = Srt> {
        prop::array::uniform16(-2.0f32..2.0).prop_map(|n| Srt {
            scale: [n[0], n[1], n[2]],
            shear: [n[3], n[4], n[5]],
            pivot: [n[6] * 100.0, n[7], n[8]],
            quaternion: [n[9], n[10], n[11], n[12]],
            translation: [n[13], n[14] * 1e4, n[15]],
        })
    }

    /// Images of corners and of a point inside, at many times.
    fn check(motion: &Motion, times: &[f32]) -> Result<(), TestCaseError> {
        let around = Bounds { min: [-1.0, 0.5, -3.0], max: [2.0, 0.75, 3.0] };
        let all = bounds(&around, motion);
        for &time in times {
            let Some(matrix) = motion.at(time) else { continue };
            for corner in 0..9 {
                let point: [f64; 3] = array::from_fn(|axis| match (corner, corner >> axis & 1) {
                    (8, _) => 0.5 * f64::from(around.min[axis] + around.max[axis]),
                    (_, 0) => around.min[axis].into(),
                    _ => around.max[axis].into(),
                });
                for (row, entries) in matrix.iter().enumerate() {
                    let image =
                        (0..3).map(|j| f64::from(entries[j]) * point[j]).sum::<f64>() + f64::from(entries[3]);
                    let rounding = 2f64.powi(-40) * image.abs().max(1.0);
                    prop_assert!(image >= f64::from(all.min[row]) - rounding, "{time} {corner} {row}");
                    prop_assert!(image <= f64::from(all.max[row]) + rounding, "{time} {corner} {row}");
                }
            }
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn no_image_leaves_the_box(
            first in key(),
            second in key(),
            times in prop::array::uniform32(0.0f32..=1.0),
        ) {
            check(&Motion::Srt(Box::new([first, second])), &times)?;
            let ends = [first, second].map(|key| Motion::Srt(Box::new([key, key])).at(0.0));
            if let [Some(a), Some(b)] = ends {
                check(&Motion::Matrix([a, b]), &times)?;
            }
        }
    }

    #[test]
    fn a_slow_turn_far_from_its_pivot_has_a_small_box() {
        // By 10 degrees about y, 100 from the pivot, back and forth: an arc of 17 by 1.5.
        let rotated = |degrees: f32| {
            let half = (degrees / 2.0).to_radians();
            let pivot = [100.0, 0.0, 0.0];
            Srt { pivot, quaternion: [0.0, half.sin(), 0.0, half.cos()], ..Srt::default() }
        };
        let around = Bounds { min: [-1.0; 3], max: [1.0; 3] };
        let all = bounds(&around, &Motion::Srt(Box::new([rotated(0.0), rotated(10.0)])));
        assert!(all.max[0] - all.min[0] < 12.0 && all.max[2] - all.min[2] < 28.0, "{all:?}");
        assert!(all.max[1] <= 1.0001 && all.min[1] >= -1.0001, "{all:?}");
    }
}
