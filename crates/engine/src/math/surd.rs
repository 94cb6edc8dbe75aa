//! Numbers of the form (p + q sqrt r) / d with dyadic p, q, r, d: the t of the intersection of a
//! ray with a plane, sphere or cone. Their signs and comparisons with floats are exact, and so is
//! their rounding to `f32`.

use std::cmp::Ordering;

use super::exact::Dyadic;

/// `(p + q sqrt r) / d`, with r >= 0 and d != 0.
#[derive(Clone, Debug)]
pub struct Surd {
    p: Dyadic,
    q: Dyadic,
    r: Dyadic,
    d: Dyadic,
}

impl Surd {
    /// `(p + q sqrt r) / d`. A negative r or a zero d is a bug of the caller.
    pub fn new(p: Dyadic, q: Dyadic, r: Dyadic, d: Dyadic) -> Self {
        assert!(r.sign() >= 0 && d.sign() != 0, "bug in anyhit: not a real number");
        Self { p, q, r, d }
    }

    /// `p / d`. A zero d is a bug of the caller.
    pub fn ratio(p: Dyadic, d: Dyadic) -> Self {
        Self::new(p, Dyadic::zero(), Dyadic::zero(), d)
    }

    /// The sign of the number: -1, 0 or 1.
    pub fn sign(&self) -> i32 {
        sign_of_sum(&self.p, &self.q, &self.r) * self.d.sign()
    }

    /// `(a + b self) / c`. A zero c is a bug of the caller.
    #[must_use]
    pub fn affine(&self, a: &Dyadic, b: &Dyadic, c: &Dyadic) -> Self {
        let p = &(a * &self.d) + &(b * &self.p);
        Self::new(p, b * &self.q, self.r.clone(), c * &self.d)
    }

    /// Compares the number with a dyadic number.
    pub fn compare(&self, other: &Dyadic) -> Ordering {
        let p = &self.p - &(other * &self.d);
        (sign_of_sum(&p, &self.q, &self.r) * self.d.sign()).cmp(&0)
    }

    /// Compares the number with a float, infinities included. NaN is a bug of the caller.
    pub fn compare_f32(&self, other: f32) -> Ordering {
        assert!(!other.is_nan(), "bug in anyhit: NaN has no order");
        if other == f32::INFINITY {
            Ordering::Less
        } else if other == f32::NEG_INFINITY {
            Ordering::Greater
        } else {
            self.compare(&Dyadic::from_f32(other))
        }
    }

    /// p, q, r and d of `(p + q sqrt r) / d`.
    pub fn parts(&self) -> [&Dyadic; 4] {
        [&self.p, &self.q, &self.r, &self.d]
    }

    /// The nearest `f32`, ties to even; +0 for zero, infinity beyond the range.
    pub fn to_f32(&self) -> f32 {
        let (m, e) = self.approximate();
        round(m, e, |midpoint| self.compare(&midpoint))
    }

    /// The nearest `f32` to the square root, ties to even. A negative number is a bug of the
    /// caller.
    pub fn sqrt_to_f32(&self) -> f32 {
        let (mut m, mut e) = self.approximate();
        assert!(m >= 0.0, "bug in anyhit: the square root of a negative number");
        if e.rem_euclid(2) == 1 {
            m *= 2.0;
            e -= 1;
        }
        // Both sides of the comparison are positive.
        round(m.sqrt(), e / 2, |midpoint| self.compare(&midpoint.square()))
    }

    /// `(m, e)` with the value `m * 2^e` to a relative error below 2^-47; m is 0 only for 0.
    ///
    /// Where p and q sqrt r cancel, (p + q sqrt r) = (p^2 - q^2 r) / (p - q sqrt r), whose
    /// numerator is exact and whose denominator does not cancel: no step below loses more than a
    /// few roundings.
    fn approximate(&self) -> (f64, i64) {
        let p = self.p.to_scaled();
        let (mut rm, mut re) = self.r.to_scaled();
        if re.rem_euclid(2) == 1 {
            rm *= 2.0;
            re -= 1;
        }
        let (qm, qe) = self.q.to_scaled();
        let root = (qm * rm.sqrt(), qe + re / 2);
        let (m, e) = if p.0 * root.0 >= 0.0 {
            sum(p, root)
        } else {
            let product = &self.p.square() - &(&self.q.square() * &self.r);
            let (nm, ne) = product.to_scaled();
            let (dm, de) = sum(p, (-root.0, root.1));
            (nm / dm, ne - de)
        };
        let (dm, de) = self.d.to_scaled();
        (m / dm, e - de)
    }
}

/// The nearest `f32` of a number that is `m * 2^e` to a relative error below 2^-46, and that
/// `compare` compares exactly with others.
fn round(m: f64, e: i64, compare: impl FnOnce(Dyadic) -> Ordering) -> f32 {
    if m == 0.0 {
        return 0.0;
    }
    // Beyond these every f32 rounds to 0 or infinity, and f64 need not hold the number.
    let value = ldexp(m, e.clamp(-300, 200));
    let below = (value - value.abs() * 2f64.powi(-44)) as f32;
    let above = (value + value.abs() * 2f64.powi(-44)) as f32;
    if below == above {
        return below + 0.0;
    }
    let rounded = match compare(Dyadic::from_f64(midpoint(below, above))) {
        Ordering::Less => below,
        Ordering::Greater => above,
        Ordering::Equal if below.to_bits() & 1 == 0 => below,
        Ordering::Equal => above,
    };
    rounded + 0.0
}

/// The sign of p + q sqrt r for r >= 0, by squaring where the summands differ in sign.
fn sign_of_sum(p: &Dyadic, q: &Dyadic, r: &Dyadic) -> i32 {
    let root = q.sign() * r.sign();
    if root == 0 || p.sign() == root {
        return p.sign();
    }
    if p.is_zero() {
        return root;
    }
    p.sign() * (&p.square() - &(&q.square() * r)).sign()
}

/// The sum of two scaled numbers of like sign (or zero).
fn sum(a: (f64, i64), b: (f64, i64)) -> (f64, i64) {
    if a.0 == 0.0 {
        return b;
    }
    if b.0 == 0.0 {
        return a;
    }
    let (great, small) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    (great.0 + ldexp(small.0, (small.1 - great.1).max(-200)), great.1)
}

/// `m * 2^e` for |e| <= 300 and m near 1.
fn ldexp(m: f64, e: i64) -> f64 {
    m * 2f64.powi(e as i32)
}

/// The number half-way between two neighbouring `f32`s, where the upper one may be infinity (or
/// the lower one its negative), which then stands for 2^128.
fn midpoint(below: f32, above: f32) -> f64 {
    let value = |x: f32| if x.is_infinite() { 2f64.powi(128).copysign(x.into()) } else { x.into() };
    f64::midpoint(value(below), value(above))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn int(value: i64) -> Dyadic {
        Dyadic::integer(value)
    }

    #[test]
    fn signs_are_exact_where_the_summands_nearly_cancel() {
        // sqrt(10^16 + 1) > 10^8 and sqrt(10^16) = 10^8.
        let near = |r: i64| Surd::new(int(-100_000_000), int(1), int(r), int(1)).sign();
        let square = 10_000_000_000_000_000;
        assert_eq!([near(square - 1), near(square), near(square + 1)], [-1, 0, 1]);
    }

    #[test]
    fn the_denominators_sign_counts() {
        let x = Surd::new(int(1), int(1), int(2), int(-1));
        assert_eq!(x.sign(), -1);
        // -(1 + sqrt 2) = -2.414...
        assert_eq!(x.compare_f32(-2.5), Ordering::Greater);
        assert_eq!(x.compare_f32(-2.4), Ordering::Less);
        assert_eq!(x.compare_f32(f32::NEG_INFINITY), Ordering::Greater);
    }

    #[test]
    fn rounding_is_to_nearest_even() {
        let third = Surd::ratio(int(1), int(3));
        assert_eq!(third.to_f32(), 1.0 / 3.0);
        assert_eq!(Surd::new(int(0), int(1), int(2), int(1)).to_f32(), std::f32::consts::SQRT_2);
        // 2^24 + 1 lies half-way between 2^24 and 2^24 + 2; 2^24 + 3 between + 2 and + 4.
        assert_eq!(Surd::ratio(int((1 << 24) + 1), int(1)).to_f32(), 16_777_216.0);
        assert_eq!(Surd::ratio(int((1 << 24) + 3), int(1)).to_f32(), 16_777_220.0);
        // A hair above the tie: 2^24 + 1 + 2^-40, as (2^64 + 2^40 + 1) / 2^40 in pieces.
        let tie = &int((1 << 24) + 1) * &int(1 << 40);
        assert_eq!(Surd::ratio(&tie + &int(1), int(1 << 40)).to_f32(), 16_777_218.0);
        assert_eq!(Surd::ratio(&tie - &int(1), int(1 << 40)).to_f32(), 16_777_216.0);
    }

    #[test]
    fn square_roots_round_to_nearest() {
        assert_eq!(Surd::ratio(int(1), int(4)).sqrt_to_f32(), 0.5);
        assert_eq!(Surd::ratio(int(2), int(1)).sqrt_to_f32(), std::f32::consts::SQRT_2);
        assert_eq!(Surd::ratio(Dyadic::zero(), int(1)).sqrt_to_f32(), 0.0);
        // sqrt(3 - 2 sqrt 2) = sqrt 2 - 1, in which nearly all of 3 cancels.
        let x = Surd::new(int(3), int(-2), int(2), int(1));
        assert_eq!(x.sqrt_to_f32(), (std::f64::consts::SQRT_2 - 1.0) as f32);
        // (2^24 + 1)^2: half-way between 2^24 and 2^24 + 2.
        let tie = int((1 << 24) + 1).square();
        assert_eq!(Surd::ratio(tie.clone(), int(1)).sqrt_to_f32(), 16_777_216.0);
        assert_eq!(Surd::ratio(&tie + &int(1), int(1)).sqrt_to_f32(), 16_777_218.0);
    }

    #[test]
    fn rounding_reaches_the_ends_of_the_range() {
        let max = Dyadic::from_f32(f32::MAX);
        // The tie between MAX and 2^128 is MAX + 2^103 and goes to the even neighbour, 2^128.
        let tie = &max + &Dyadic::from_f64(2f64.powi(103));
        assert_eq!(Surd::ratio(tie.clone(), int(1)).to_f32(), f32::INFINITY);
        assert_eq!(Surd::ratio(&tie - &int(1), int(1)).to_f32(), f32::MAX);
        assert_eq!(Surd::ratio(max.square(), int(1)).to_f32(), f32::INFINITY);
        let least = Dyadic::from_f32(f32::from_bits(1));
        assert_eq!(Surd::ratio(least.clone(), int(2)).to_f32().to_bits(), 0);
        assert_eq!(Surd::ratio(&least * &int(3), int(2)).to_f32(), f32::from_bits(2));
        assert_eq!(Surd::ratio(&least.square() * &least.square(), int(-1)).to_f32().to_bits(), 0);
    }

    #[test]
    fn a_cancelled_difference_rounds_correctly() {
        // sqrt(10^16 + 1) - 10^8 = 1 / (sqrt(10^16 + 1) + 10^8) = 5e-9 - 1.25e-25...
        let x = Surd::new(int(-100_000_000), int(1), int(10_000_000_000_000_001), int(1));
        assert_eq!(x.to_f32(), 5e-9);
    }
}
