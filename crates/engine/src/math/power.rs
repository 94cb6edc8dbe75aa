//! Correctly rounded powers: the cases that `pxfm` does not round correctly.

use crate::math::exponent::Exponent;

/// `x^y` in f32, correctly rounded.
///
/// `pxfm::f_powf` rounds some exact powers that lie in the middle of two numbers to the odd one;
/// these are computed exactly here.
#[must_use]
pub fn pow_f32(x: f32, y: f32) -> f32 {
    match exact(x.into(), y.into()) {
        Some(power) => power as f32,
        None => with_sign(x.into(), y.into(), pxfm::f_powf(x, y).into()) as f32,
    }
}

/// `x^y` in f64, at most one unit in the last place off.
#[must_use]
pub fn pow_f64(x: f64, y: f64) -> f64 {
    match (x, y) {
        // Even of a NaN (IEEE 754-2019, 9.2.1).
        (1.0, _) | (_, 0.0) => 1.0,
        // For which the crate's power gives NaN where x is large.
        (_, -0.5) if x > 0.0 => pxfm::f_rsqrt(x),
        _ => with_sign(x, y, pxfm::f_pow(x, y)),
    }
}

/// An odd power of a negative base has its sign, which the crate's functions forget for -0 and
/// where the power underflows.
fn with_sign(x: f64, y: f64, power: f64) -> f64 {
    let odd = x.is_sign_negative() && (y % 2.0).abs() == 1.0 && !power.is_nan();
    if odd { -power.abs() } else { power }
}

/// The power where it has at most 53 bits and the exponent is a multiple of 1/8. An exact power
/// that has 25 bits, and so is a middle of two f32, has such an exponent, or its base is a power of
/// two: of a base of 24 bits and at least 3 there is no 16th root, as 3^16 > 2^24.
fn exact(x: f64, y: f64) -> Option<f64> {
    let eighths = y * 8.0;
    if !x.is_finite() || x == 0.0 || eighths % 1.0 != 0.0 || eighths.abs() > 4096.0 {
        return None;
    }
    let negative = x < 0.0;
    if negative && y % 1.0 != 0.0 {
        return None;
    }
    // |x| is base * 2^exponent, the base odd.
    let (mantissa, exponent) = x.abs().frexp();
    let significand = mantissa.ldexp(53) as u64;
    let zeros = significand.trailing_zeros();
    let (mut base, mut exponent) = (significand >> zeros, i64::from(exponent) - 53 + i64::from(zeros));
    // y is power / 2^roots.
    let (mut power, mut roots) = (eighths as i64, 3);
    while roots > 0 && power % 2 == 0 {
        power /= 2;
        roots -= 1;
    }
    for _ in 0..roots {
        let root = base.isqrt();
        if root * root != base || exponent % 2 != 0 {
            return None;
        }
        (base, exponent) = (root, exponent / 2);
    }
    let raised = match base {
        1 => 1,
        _ => base.checked_pow(u32::try_from(power).ok()?).filter(|&raised| raised < 1 << 53)?,
    };
    let exponent = (exponent * power).clamp(-4096, 4096) as i32;
    let value = (raised as f64).ldexp(exponent);
    Some(if negative && y % 2.0 != 0.0 { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middles_are_rounded_to_even() {
        // 62^5 = 31^5 2^5 = 28629151 * 2^5, and 28629151 = 2 * 14314575 + 1: to the even 14314576 *
        // 2^6.
        assert_eq!(pow_f32(3844.0, 2.5), 14_314_576.0 * 64.0);
        // 4097^2 = 2^24 + 2^13 + 1 is a middle; 5^11 = 48828125 has 26 bits and is none.
        assert_eq!(pow_f32(4097.0, 2.0), 16_785_408.0);
        assert_eq!(pow_f32(-4097.0, 2.0), 16_785_408.0);
        assert_eq!(pow_f32(5.0, 11.0), 48_828_124.0);
        assert_eq!(pow_f32(-5.0, 3.0), -125.0);
        // 3 * 2^-150 is the middle of 2^-149 and 2^-148, the even one; 2^-150 that of 0 and 2^-149.
        assert_eq!(pow_f32(9.0 * 2f32.powi(-100), 0.5), 3.0 * 2f32.powi(-50));
        assert_eq!(pow_f32(2f32.powi(-75), 2.0), 0.0);
        assert_eq!(pow_f32(2f32.powi(-100), 1.5).to_bits(), 0);
        assert_eq!(pow_f32(3.0 * 2f32.powi(-75), 2.0).to_bits(), 4); // 4.5 units
        assert_eq!(pow_f32(2f32.powi(64), 2.0), f32::INFINITY);
        assert_eq!(pow_f32(2f32.powi(-64), -1.5), 2f32.powi(96));
    }

    #[test]
    fn zeros_ones_and_nan() {
        // IEEE 754-2019, 9.2.1: an odd integer, positive or negative, and any other number.
        assert_eq!(pow_f32(-0.0, 3.0).to_bits(), 0x8000_0000);
        assert_eq!(pow_f32(-0.0, -7.0), f32::NEG_INFINITY);
        assert_eq!([pow_f32(-0.0, 2.0).to_bits(), pow_f32(-0.0, 0.5).to_bits()], [0, 0]);
        assert_eq!(pow_f64(-0.0, 5.0).to_bits(), (-0.0f64).to_bits());
        assert_eq!([pow_f64(-0.0, -1.0), pow_f64(-0.0, -2.0)], [f64::NEG_INFINITY, f64::INFINITY]);
        // What underflows has the sign that the power would have: -10^-400, -10^-50, 10^-600.
        assert_eq!(pow_f64(-1e-80, 5.0).to_bits(), (-0.0f64).to_bits());
        assert_eq!(pow_f32(-1e-10, 5.0).to_bits(), 0x8000_0000);
        assert_eq!(pow_f64(-1e-100, 6.0).to_bits(), 0);
        assert_eq!(pow_f64(2f64.powi(1022), -0.5), 2f64.powi(-511));
        assert_eq!([pow_f64(f64::INFINITY, -0.5), pow_f64(-0.0, -0.5)], [0.0, f64::INFINITY]);
        assert_eq!([pow_f64(f64::NAN, 0.0), pow_f64(1.0, f64::NAN), pow_f64(f64::NAN, -0.0)], [1.0; 3]);
        assert_eq!([pow_f32(f32::NAN, 0.0), pow_f32(1.0, f32::NAN)], [1.0; 2]);
        assert!(pow_f32(-2.0, 0.5).is_nan() && pow_f64(-2.0, 0.5).is_nan());
    }
}
