//! The build-time transform of triangle vertices, correctly rounded.
//!
//! A vertex after the geometry transform is the correctly rounded f32 of the exact product, so that
//! position fetch gives the same bits on every machine. Each product of two f32 is exact in f64 (48
//! bits); their sum is kept as an expansion (Shewchuk, "Adaptive precision floating-point
//! arithmetic", 1997) and rounded to odd in f64 first, which makes the second rounding to f32 right
//! (Boldo and Melquiond, "Emulation of FMA and correctly rounded sums", 2008).

use crate::math::array;

/// The identity as a row-major 3x4 matrix.
pub(super) const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// The correctly rounded image of a point under a row-major 3x4 matrix.
pub(super) fn transform_point(matrix: &[[f32; 4]; 3], point: [f32; 3]) -> [f32; 3] {
    array::map(*matrix, |row| {
        let product = |k: usize| f64::from(row[k]) * f64::from(point[k]);
        round_sum([product(0), product(1), product(2), f64::from(row[3])])
    })
}

/// The correctly rounded f32 of an exact sum of products of f32.
pub(super) fn round_sum(terms: [f64; 4]) -> f32 {
    // Infinities and NaN follow IEEE addition.
    let plain: f64 = terms.iter().sum();
    if !plain.is_finite() {
        return plain as f32;
    }
    // Grow the expansion: `parts` never overlap and ascend in magnitude.
    let mut parts = [0.0f64; 4];
    for (length, &term) in terms.iter().enumerate() {
        let mut carry = term;
        for part in &mut parts[..length] {
            let (sum, error) = two_sum(carry, *part);
            *part = error;
            carry = sum;
        }
        parts[length] = carry;
    }
    // Sum from the top until an error remains: then `high` is the nearest f64 of all parts above it
    // and the rest only matters by its sign.
    let mut high = parts[3];
    let mut rest = 0.0f64;
    for k in (0..3).rev() {
        let (sum, error) = two_sum(high, parts[k]);
        high = sum;
        if error != 0.0 {
            rest = error;
            break;
        }
    }
    if rest == 0.0 {
        return high as f32;
    }
    // To odd: where the sum is inexact and the last bit is even, take the neighbour on the side of
    // the rest, whose last bit is odd.
    if high.to_bits() & 1 == 0 {
        high = if rest > 0.0 { high.next_up() } else { high.next_down() };
    }
    high as f32
}

/// Knuth's exact sum: `a + b = sum + error`.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    let a_part = sum - b_part;
    (sum, (a - a_part) + (b - b_part))
}

#[cfg(test)]
mod tests {
    use dashu_base::{Approximation, BitTest};
    use dashu_ratio::RBig;
    use proptest::prelude::*;

    use super::*;

    /// The nearest f32 by rational arithmetic.
    fn reference(row: [f32; 4], point: [f32; 3]) -> f32 {
        let exact = |x: f32| RBig::try_from(x).expect("finite");
        let sum = exact(row[0]) * exact(point[0])
            + exact(row[1]) * exact(point[1])
            + exact(row[2]) * exact(point[2])
            + exact(row[3]);
        if sum.numerator().bit_len() == 0 {
            return 0.0;
        }
        match sum.to_f32() {
            Approximation::Exact(x) | Approximation::Inexact(x, _) => x,
        }
    }

    fn any_scale() -> impl Strategy<Value = f32> {
        (any::<i32>(), -60i32..60).prop_map(|(mantissa, exponent)| mantissa as f32 * (exponent as f32).exp2())
    }

    proptest! {
        #[test]
        fn points_are_correctly_rounded(
            row in prop::array::uniform4(any_scale()),
            point in prop::array::uniform3(any_scale()),
            cancel in any::<bool>(),
        ) {
            let mut row = row;
            if cancel {
                // The translation takes nearly all of the rest away.
                row[3] = -(row[0] * point[0] + row[1] * point[1] + row[2] * point[2]);
            }
            prop_assume!(row[3].is_finite());
            let ours = transform_point(&[row, row, row], point)[0];
            let right = reference(row, point);
            prop_assert!(ours == right, "{ours:e} is not {right:e}");
        }
    }

    #[test]
    fn half_way_cases_see_the_far_bits() {
        // 1 + 2^-24 is half way between two f32; 2^-80 tips it over, and its negative back.
        let tip = (-80f32).exp2();
        let half = (-24f32).exp2();
        assert_eq!(transform_point(&[[1.0, half, tip, 0.0]; 3], [1.0; 3])[0], 1.0f32.next_up());
        assert_eq!(transform_point(&[[1.0, half, -tip, 0.0]; 3], [1.0; 3])[0], 1.0);
        assert_eq!(transform_point(&[[1.0, half, 0.0, 0.0]; 3], [1.0; 3])[0], 1.0);
    }
}
