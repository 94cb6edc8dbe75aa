//! Motion in rational numbers: from the definition at the head of `accel::motion`
//! (numbers at a time are those between the keys, and each that traversal works with is rounded
//! once), but the rotation as a product of quaternions.

use std::array::from_fn;

use dashu_ratio::RBig;

use crate::case::MotionKeys;
use crate::reference::{Root, rational, sign};

type Matrix = [[f32; 4]; 3];

/// Whether a number is the interpolation of two keys at a time, rounded once.
pub fn is_between([first, second]: [f32; 2], time: f32, number: f32) -> bool {
    Root::from(between([first, second], time)).rounds_to(number)
}

fn between([first, second]: [f32; 2], time: f32) -> RBig {
    let t = rational(time);
    (RBig::ONE - &t) * rational(first) + t * rational(second)
}

/// Whether a matrix is that of an instance at a time; `None` stands for an instance without one.
pub fn is_transform(moves: &MotionKeys, time: f32, matrix: Option<&Matrix>) -> bool {
    let rounds = |exact: [[RBig; 4]; 3], matrix: &Matrix| {
        let exact = exact.into_iter().flatten();
        exact.zip(matrix.as_flattened()).all(|(exact, &entry)| Root::from(exact).rounds_to(entry))
    };
    match (moves, matrix) {
        (MotionKeys::Matrix([first, second]), Some(matrix)) => {
            let at = |i: usize, j: usize| between([first[i][j], second[i][j]], time);
            rounds(from_fn(|i| from_fn(|j| at(i, j))), matrix)
        }
        (MotionKeys::Matrix(_), None) => false,
        (MotionKeys::Srt(keys), matrix) => match (compose(keys, time), matrix) {
            (Some(exact), Some(matrix)) => rounds(exact, matrix),
            (exact, matrix) => exact.is_none() == matrix.is_none(),
        },
    }
}

/// The matrix T R S at a time; `None` where the quaternion is 0.
fn compose([first, second]: &[[f32; 16]; 2], time: f32) -> Option<[[RBig; 4]; 3]> {
    let numbers: [RBig; 16] = from_fn(|at| between([first[at], second[at]], time));
    let [sx, a, b, pvx, sy, c, pvy, sz, pvz, x, y, z, w, translation @ ..] = numbers;
    let norm = &x * &x + &y * &y + &z * &z + &w * &w;
    if sign(&norm) == 0 {
        return None;
    }
    let zero = || RBig::ZERO;
    let columns = [[sx, zero(), zero()], [a, sy, zero()], [b, c, sz], [pvx, pvy, pvz]];
    let quaternion = [w, x, y, z];
    let conjugate: [RBig; 4] = from_fn(|k| if k == 0 { quaternion[0].clone() } else { -&quaternion[k] });
    let mut out: [[RBig; 4]; 3] = from_fn(|_| from_fn(|_| RBig::ZERO));
    for (j, [vx, vy, vz]) in columns.into_iter().enumerate() {
        let rotated = product(&product(&quaternion, &[zero(), vx, vy, vz]), &conjugate);
        for i in 0..3 {
            let translated = if j == 3 { translation[i].clone() } else { zero() };
            out[i][j] = &rotated[i + 1] / &norm + translated;
        }
    }
    Some(out)
}

/// The product of quaternions; the real part is first.
fn product([a, b, c, d]: &[RBig; 4], [e, f, g, h]: &[RBig; 4]) -> [RBig; 4] {
    [
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_between_keys_are_rounded_once() {
        assert!(is_between([3.0, 5.0], 0.25, 3.5));
        // 1 + 2^-24 is half way: to even.
        let t = 2f32.powi(-24);
        assert!(is_between([1.0, 2.0], t, 1.0) && !is_between([1.0, 2.0], t, 1.0f32.next_up()));
        let moves = MotionKeys::Matrix([[[0.0; 4]; 3], [[1.0; 4]; 3]]);
        assert!(is_transform(&moves, 0.5, Some(&[[0.5; 4]; 3])));
        assert!(!is_transform(&moves, 0.5, Some(&[[0.5, 0.5, 0.5, 0.25]; 3])));
        assert!(!is_transform(&moves, 0.5, None));
    }

    #[test]
    fn a_decomposition_is_composed_as_defined() {
        // Scale (2, 3, 4), shear (1/2, 1/4, 1/8), pivot (10, 20, 30), a right angle about z, which
        // takes (x, y, z) to (-y, x, z), and a move by (1, 2, 3).
        let key = [2.0, 0.5, 0.25, 10.0, 3.0, 0.125, 20.0, 4.0, 30.0, 0.0, 0.0, 2.0, 2.0, 1.0, 2.0, 3.0];
        let expected = [[0.0, -3.0, -0.125, -19.0], [2.0, 0.5, 0.25, 12.0], [0.0, 0.0, 4.0, 33.0]];
        assert!(is_transform(&MotionKeys::Srt([key; 2]), 0.3, Some(&expected)));
        let mut off = expected;
        off[1][2] = off[1][2].next_up();
        assert!(!is_transform(&MotionKeys::Srt([key; 2]), 0.3, Some(&off)));
        // From q to -q: nothing half way.
        let mut other = key;
        (other[11], other[12]) = (-2.0, -2.0);
        assert!(is_transform(&MotionKeys::Srt([key, other]), 0.5, None));
        assert!(!is_transform(&MotionKeys::Srt([key, other]), 0.5, Some(&expected)));
    }
}
