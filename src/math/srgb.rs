//! The sRGB transfer functions (Khronos Data Format Specification 13.3; IEC 61966-2-1).
//!
//! They are computed in f64, whose powers are right to a few units in the last place, so that a
//! result rounded once to f32 or to eight bits is the nearest one.

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

#[cfg(test)]
mod tests {
    use super::*;

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
