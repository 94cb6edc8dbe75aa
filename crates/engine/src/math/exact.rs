//! Exact arithmetic on dyadic numbers (integers times powers of two).
//!
//! Every finite float is dyadic and the set is closed under `+ - *`: any polynomial of a ray and a
//! primitive is found without rounding, at any exponent. Division and square roots are never
//! needed: questions about quotients and roots become signs of polynomials ([`super::surd`]).

use std::cmp::Ordering;
use std::ops::{Add, Mul, Neg, Sub};

use num_bigint::{BigInt, Sign};

/// `mantissa * 2^exponent`, exact. Not normalised: compare with [`Dyadic::compare`].
#[derive(Clone, Debug)]
pub struct Dyadic {
    mantissa: BigInt,
    exponent: i64,
}

impl Dyadic {
    /// The number 0.
    pub fn zero() -> Self {
        Self { mantissa: BigInt::ZERO, exponent: 0 }
    }

    /// Makes a small integer.
    pub fn integer(value: i64) -> Self {
        Self { mantissa: value.into(), exponent: 0 }
    }

    /// The exact value of a finite float. An infinity or NaN is a bug of the caller.
    pub fn from_f32(value: f32) -> Self {
        Self::from_f64(value.into())
    }

    /// The exact value of a finite float. An infinity or NaN is a bug of the caller.
    pub fn from_f64(value: f64) -> Self {
        assert!(value.is_finite(), "bug in anyhit: {value} has no exact value");
        if value == 0.0 {
            return Self::zero();
        }
        let bits = value.to_bits();
        let biased = ((bits >> 52) & 0x7FF) as i64;
        let fraction = bits & ((1 << 52) - 1);
        let (magnitude, exponent) =
            if biased == 0 { (fraction, -1074) } else { (fraction | (1 << 52), biased - 1075) };
        // Short mantissas keep products short: most inputs have 24 bits, many far fewer.
        let zeros = magnitude.trailing_zeros();
        let mantissa = (magnitude >> zeros) as i64;
        let mantissa = if value < 0.0 { -mantissa } else { mantissa };
        Self { mantissa: mantissa.into(), exponent: exponent + i64::from(zeros) }
    }

    /// The sign of the number: -1, 0 or 1.
    pub fn sign(&self) -> i32 {
        match self.mantissa.sign() {
            Sign::Minus => -1,
            Sign::NoSign => 0,
            Sign::Plus => 1,
        }
    }

    /// Whether the number is 0.
    pub fn is_zero(&self) -> bool {
        self.sign() == 0
    }

    /// The square of the number.
    #[must_use]
    pub fn square(&self) -> Self {
        self * self
    }

    /// The absolute value.
    #[must_use]
    pub fn abs(&self) -> Self {
        if self.sign() < 0 { -self } else { self.clone() }
    }

    /// Compares two numbers.
    pub fn compare(&self, other: &Self) -> Ordering {
        (self - other).sign().cmp(&0)
    }

    /// `(m, e)` with the value `m * 2^e`, m off by less than 2^-52 relatively, |m| in [1, 2) or 0.
    pub fn to_scaled(&self) -> (f64, i64) {
        let bits = self.mantissa.bits() as i64;
        if bits == 0 {
            return (0.0, 0);
        }
        let drop = (bits - 64).max(0);
        let top: BigInt = self.mantissa.magnitude().clone().into();
        let top = u64::try_from(top >> drop).expect("bug in anyhit: 64 bits are a u64");
        let kept = bits - drop;
        // top has `kept` bits; its float lies in [2^(kept-1), 2^kept].
        let m = top as f64 * 2f64.powi(1 - kept as i32);
        let m = if self.sign() < 0 { -m } else { m };
        (m, self.exponent + drop + kept - 1)
    }
}

impl Add for &Dyadic {
    type Output = Dyadic;

    fn add(self, other: Self) -> Dyadic {
        if self.is_zero() {
            return other.clone();
        }
        if other.is_zero() {
            return self.clone();
        }
        let exponent = self.exponent.min(other.exponent);
        let mantissa = (&self.mantissa << (self.exponent - exponent) as u64)
            + (&other.mantissa << (other.exponent - exponent) as u64);
        Dyadic { mantissa, exponent }
    }
}

impl Sub for &Dyadic {
    type Output = Dyadic;

    fn sub(self, other: Self) -> Dyadic {
        self + &-other
    }
}

impl Mul for &Dyadic {
    type Output = Dyadic;

    fn mul(self, other: Self) -> Dyadic {
        Dyadic { mantissa: &self.mantissa * &other.mantissa, exponent: self.exponent + other.exponent }
    }
}

impl Neg for &Dyadic {
    type Output = Dyadic;

    fn neg(self) -> Dyadic {
        Dyadic { mantissa: -&self.mantissa, exponent: self.exponent }
    }
}

/// Three exact components.
pub type Vector = [Dyadic; 3];

/// The exact value of a finite vector.
pub fn vector(v: [f32; 3]) -> Vector {
    v.map(Dyadic::from_f32)
}

/// `a - b`.
pub fn sub(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| &a[i] - &b[i])
}

/// `a + b`.
pub fn add(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| &a[i] + &b[i])
}

/// `s * v`.
pub fn scale(s: &Dyadic, v: &Vector) -> Vector {
    std::array::from_fn(|i| s * &v[i])
}

/// The dot product.
pub fn dot(a: &Vector, b: &Vector) -> Dyadic {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

/// The cross product.
pub fn cross(a: &Vector, b: &Vector) -> Vector {
    let minor = |i: usize, j: usize| &(&a[i] * &b[j]) - &(&a[j] * &b[i]);
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_over_the_whole_exponent_range_lose_nothing() {
        let huge = Dyadic::from_f32(f32::MAX);
        let tiny = Dyadic::from_f32(f32::from_bits(1));
        let sum = &huge + &tiny;
        assert_eq!((&sum - &huge).compare(&tiny), Ordering::Equal);
        assert_eq!(sum.compare(&huge), Ordering::Greater);
        assert_eq!((-&sum).compare(&huge), Ordering::Less);
    }

    #[test]
    fn a_square_is_a_square() {
        // (2^23 + 1)^2 = 2^46 + 2^24 + 1.
        let x = Dyadic::integer((1 << 23) + 1);
        assert_eq!(x.square().compare(&Dyadic::integer((1 << 46) + (1 << 24) + 1)), Ordering::Equal);
    }

    #[test]
    fn scaled_floats_keep_value_and_sign() {
        assert_eq!(Dyadic::from_f64(-6.0).to_scaled(), (-1.5, 2));
        assert_eq!(Dyadic::from_f64(5e-324).to_scaled(), (1.0, -1074));
        assert_eq!(Dyadic::zero().to_scaled(), (0.0, 0));
        let (m, e) = (&Dyadic::integer(i64::MAX) * &Dyadic::integer(i64::MAX)).to_scaled();
        // (2^63 - 1)^2 rounds to 2^126.
        assert_eq!(m * 2f64.powi((e - 120) as i32), 64.0);
    }
}
