//! The sRGB transfer functions (Khronos Data Format Specification 13.3; IEC 61966-2-1).
//!
//! They are computed in f64, whose powers are right to a few units in the last place, so that a
//! result rounded once to f32 or to eight bits is the nearest one.

use std::sync::LazyLock;

use crate::math::array;

/// A value as encoded in an sRGB image, made linear; [0, 1] to [0, 1].
pub fn to_linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { pxfm::f_pow((encoded + 0.055) / 1.055, 2.4) }
}

/// A linear value as an sRGB image encodes it; values outside [0, 1] are clamped, not a number
/// is 0.
pub fn from_linear(linear: f64) -> f64 {
    let linear = if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) };
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * pxfm::f_pow(linear, 1.0 / 2.4) - 0.055 }
}

/// The code of a linear value in 8 bits: [`from_linear`] times 255, rounded to nearest even.
///
/// A search among the values where the code changes takes a tenth of the time of a power. Next to
/// one of these, where the power's error may decide, the power is computed.
pub fn code(linear: f64) -> u8 {
    let at = FIRST_OF_CODE.partition_point(|&first| first <= linear);
    let is_close = |first: &f64| (linear - first).abs() <= 1e-12 * first;
    let neighbours = &FIRST_OF_CODE[at.saturating_sub(1)..(at + 1).min(FIRST_OF_CODE.len())];
    match neighbours.iter().any(is_close) {
        true => computed_code(linear),
        // A NaN is not above any of them.
        false => at as u8,
    }
}

fn computed_code(linear: f64) -> u8 {
    (from_linear(linear) * 255.0).round_ties_even() as u8
}

/// The least values with the codes 1 to 255, found by bisection.
static FIRST_OF_CODE: LazyLock<[f64; 255]> = LazyLock::new(|| {
    array::from_fn(|at| {
        let (mut below, mut above) = (0f64.to_bits(), 1f64.to_bits());
        while above - below > 1 {
            let middle = below + (above - below) / 2;
            match computed_code(f64::from_bits(middle)) as usize > at {
                true => above = middle,
                false => below = middle,
            }
        }
        f64::from_bits(above)
    })
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_power() {
        let steps = (0..100_000).map(|step| f64::from(step) / 99_999.0);
        let edges = FIRST_OF_CODE.iter().flat_map(|first| {
            let near = [0, 1, 2, 1000, 1 << 20].map(|ulps| [first.to_bits() + ulps, first.to_bits() - ulps]);
            near.into_iter().flatten().map(f64::from_bits)
        });
        let outside = [f64::NAN, -1.0, -0.0, f64::MIN_POSITIVE, 1.5, f64::INFINITY, f64::NEG_INFINITY];
        for linear in steps.chain(edges).chain(outside) {
            assert_eq!(code(linear), computed_code(linear), "{linear:e}");
        }
    }

    #[test]
    fn every_byte_survives_a_round_trip() {
        for byte in 0..=255u8 {
            let encoded = from_linear(to_linear(f64::from(byte) / 255.0));
            assert_eq!((encoded * 255.0).round_ties_even() as u8, byte);
        }
    }

    #[test]
    fn known_values() {
        assert_eq!(to_linear(0.0), 0.0);
        assert_eq!(to_linear(1.0), 1.0);
        // (0.555 / 1.055)^2.4, by hand with ten digits: 0.2140411405.
        assert!((to_linear(0.5) - 0.214_041_140_5).abs() < 1e-10);
        assert_eq!(from_linear(f64::NAN), 0.0);
        assert_eq!(from_linear(-1.0), 0.0);
        assert_eq!(from_linear(2.0), from_linear(1.0));
    }
}
