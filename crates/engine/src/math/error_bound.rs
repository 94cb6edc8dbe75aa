//! Forward error bounds for the floating-point filters in `geometry`.
//!
//! A bound is carried beside each value: `|computed - exact| <= error`, for vectors in the 1-norm.
//! Source of the rules: N. J. Higham, *Accuracy and Stability of Numerical Algorithms*, 2nd ed.,
//! sections 2.2 and 3.1 (standard model, inner products), with u the unit roundoff.
//!
//! The bounds are themselves computed in floating point, each of their operations losing at most
//! u relatively. Therefore every *source* of error enters with a coefficient at least 1/8 greater
//! than the theory asks (2u for one rounding, 4u for an inner product of three terms, which needs
//! 3u + O(u^2)); a bound is a sum of products of such sources and exact factors, so that this slack
//! reaches the result and outweighs the few hundred u that evaluating the bound can lose.
//!
//! Underflow: an operation that underflows is off by at most the smallest subnormal, once. The
//! callers keep their inputs in a range (`ObjectRay` refuses others) in which the bounds' second
//! order terms are far greater than that. Overflow gives an infinite bound or a NaN, and neither
//! compares as decided.

use super::real::Real;

/// The error of an inner product, vector product (in the 1-norm) or plain product of two computed
/// values with magnitudes at most `x` and `y` (1-norms) that are off by at most `ex` and `ey`.
///
/// For exact X = x + dx, Y = y + dy: |X.Y - x.y| <= |x||dy| + |y||dx| + |dx||dy|, and evaluating
/// x.y costs (3u + O(u^2)) sum |x_i y_i| <= 4u |x||y|. A component of a vector product costs
/// 2u (|x_i y_j| + |x_j y_i|), in sum at most 2u |x||y|.
#[inline(always)]
pub fn product_error<R: Real>(x: R, ex: R, y: R, ey: R) -> R {
    x * ey + y * ex + ex * ey + four_units::<R>() * (x * y)
}

/// The error of the quotient `q = n / d` of computed values that are off by at most `en` and `ed`;
/// infinite where the denominator's sign is not certain.
///
/// |n/d - N/D| <= (en + |n/d| ed) / |D| with |D| >= |d| - ed, and the division rounds once.
#[inline(always)]
pub fn quotient_error<R: Real>(q: R, en: R, d: R, ed: R) -> R {
    let min_denominator = d.abs() - ed;
    let error = (en + q.abs() * ed) / min_denominator + two_units::<R>() * q.abs();
    if min_denominator > R::ZERO { error } else { R::ONE / R::ZERO }
}

/// A denominator by which several numerators are divided: one division for all quotients and their
/// errors.
#[derive(Clone, Copy, Debug)]
pub struct Divisor<R> {
    inverse: R,
    /// An upper bound of its relative error.
    relative_error: R,
    /// At least 1 / |D| for the exact D; infinite where its sign is not certain enough.
    max_inverse: R,
}

impl<R: Real> Divisor<R> {
    /// A computed denominator that is off by at most `error`.
    ///
    /// With r = error / |d| <= 1/2: 1 / |D| <= (1 / |d|) / (1 - r) <= (1 / |d|) (1 + 2 r).
    #[inline(always)]
    pub fn new(denominator: R, error: R) -> Self {
        let inverse = R::ONE / denominator;
        let size = inverse.abs();
        let relative_error = error * size;
        let max_inverse = if relative_error + relative_error <= R::ONE {
            size + (relative_error + relative_error) * size
        } else {
            R::ONE / R::ZERO
        };
        Self { inverse, relative_error, max_inverse }
    }

    /// The quotient of a computed numerator that is off by at most `error`, and its own error.
    ///
    /// |n/d - N/D| <= (en + |n/d| ed) / |D|. The reciprocal and the product round once each, 2u and
    /// u^2 together, for which 4u stand. ed / |D| is taken as 2 ed / |d|.
    #[inline(always)]
    pub fn quotient(&self, numerator: R, error: R) -> (R, R) {
        let quotient = numerator * self.inverse;
        let relative = self.relative_error + self.relative_error + four_units::<R>();
        (quotient, error * self.max_inverse + quotient.abs() * relative)
    }
}

/// 2u: one rounding, with slack.
#[inline(always)]
pub fn two_units<R: Real>() -> R {
    R::UNIT + R::UNIT
}

/// 4u: an inner product of three terms, with slack.
#[inline(always)]
pub fn four_units<R: Real>() -> R {
    two_units::<R>() + two_units::<R>()
}

/// The greatest `f32` that is at most `value`; -infinity below the range.
pub fn round_down(value: f64) -> f32 {
    let nearest = value as f32;
    if f64::from(nearest) > value { nearest.next_down() } else { nearest }
}

/// The least `f32` that is at least `value`; infinity above the range.
pub fn round_up(value: f64) -> f32 {
    -round_down(-value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outward_rounding_brackets_the_value() {
        // 1 + 2^-30 lies between 1 and 1 + 2^-23.
        let value = 1.0 + 2f64.powi(-30);
        assert_eq!(round_down(value), 1.0);
        assert_eq!(round_up(value), 1.0 + f32::EPSILON);
        assert_eq!(round_down(1e39), f32::MAX);
        assert_eq!(round_up(1e39), f32::INFINITY);
        assert_eq!(round_up(1e-60), f32::from_bits(1));
        assert_eq!(round_down(0.5), 0.5);
    }

    #[test]
    fn an_uncertain_denominator_bounds_nothing() {
        assert_eq!(quotient_error(1.0f64, 0.1, 1.0, 1.5), f64::INFINITY);
        assert!(quotient_error(1.0f64, 0.25, 1.0, 0.5) >= 1.5);
        // N / D of N in 1 ± 1/4 and D in 1 ± 1/2 lies in 1/2 to 5/2.
        let (quotient, error) = Divisor::new(1.0f64, 0.5).quotient(1.0, 0.25);
        assert!(quotient == 1.0 && error >= 1.5 && error.is_finite());
        assert_eq!(Divisor::new(1.0f64, 0.75).quotient(1.0, 0.1).1, f64::INFINITY);
        assert!(Divisor::new(0.0f64, 0.0).quotient(1.0, 0.0).1.is_nan());
    }
}
