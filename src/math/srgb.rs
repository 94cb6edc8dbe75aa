//! The sRGB transfer functions (Khronos Data Format Specification 13.3).

/// A value as encoded in an sRGB image, made linear; [0, 1] to [0, 1].
pub fn to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { pxfm::f_powf((encoded + 0.055) / 1.055, 2.4) }
}

/// A linear value as an sRGB image encodes it; values outside [0, 1] are clamped.
pub fn from_linear(linear: f32) -> f32 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * pxfm::f_powf(linear, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_a_round_trip() {
        for byte in 0..=255u8 {
            let encoded = from_linear(to_linear(f32::from(byte) / 255.0));
            assert_eq!((encoded * 255.0).round_ties_even() as u8, byte);
        }
    }

    #[test]
    fn known_values() {
        assert_eq!(to_linear(0.0), 0.0);
        assert_eq!(to_linear(1.0), 1.0);
        // 0.5 encoded is 0.21404114 linear (IEC 61966-2-1).
        assert!((to_linear(0.5) - 0.214_041_14).abs() < 1e-7);
    }
}
