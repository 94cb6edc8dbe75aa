//! Distances between floats, counted in units in the last place.

/// How many `f32` steps lie between two numbers: 0 for equal ones (also -0 and +0), `u32::MAX`
/// where one is NaN and the other not; two NaNs are 0 apart. Infinity follows `f32::MAX`.
pub fn ulps(a: f32, b: f32) -> u32 {
    match (a.is_nan(), b.is_nan()) {
        (true, true) => 0,
        (false, false) => ordered_index(a).abs_diff(ordered_index(b)),
        _ => u32::MAX,
    }
}

/// |`value` - `exact`| in units in the last place of the `f32` binade that holds `exact`; the
/// correctly rounded value of a number in range is at most 0.5 away. NaN where either is NaN.
pub fn ulp_error(value: f32, exact: f64) -> f64 {
    if f64::from(value) == exact {
        return 0.0;
    }
    (f64::from(value) - exact).abs() / ulp_of(exact)
}

/// The distance of neighbouring `f32`s in the binade that holds `x`: at least 2^-149.
pub fn ulp_of(x: f64) -> f64 {
    let exponent = ((x.abs().to_bits() >> 52) as i32 - 1023).clamp(-126, 127);
    f64::from_bits(((exponent - 23 + 1023) as u64) << 52)
}

/// The index of a float in ascending order; neighbours have consecutive indices.
fn ordered_index(x: f32) -> i32 {
    let bits = x.to_bits() as i32;
    if bits < 0 { i32::MIN.wrapping_sub(bits) } else { bits }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_counted_across_zero_and_binades() {
        assert_eq!(ulps(1.0, 1.0), 0);
        assert_eq!(ulps(0.0, -0.0), 0);
        assert_eq!(ulps(1.0, 1.0 + f32::EPSILON), 1);
        assert_eq!(ulps(1.0, 1.0 - f32::EPSILON / 2.0), 1);
        assert_eq!(ulps(f32::from_bits(1), -f32::from_bits(1)), 2);
        assert_eq!(ulps(f32::MAX, f32::INFINITY), 1);
        assert_eq!(ulps(f32::NEG_INFINITY, f32::INFINITY), 2 * 0x7F80_0000);
        assert_eq!(ulps(f32::NAN, 1.0), u32::MAX);
    }

    #[test]
    fn an_error_is_measured_in_the_exact_values_binade() {
        // 1.5 ulp above 1: ulp is 2^-23.
        assert_eq!(ulp_error(1.0, 1.0 + 1.5 * 2f64.powi(-23)), 1.5);
        assert_eq!(ulp_error(2.0, 2.0 - 2f64.powi(-24)), 0.5);
        assert_eq!(ulp_error(0.0, 2f64.powi(-149)), 1.0);
    }
}
