//! Converts coordinates in texels to texels (Vulkan, "(u,v,w,a) to (i,j,k,l,n) Transformation" and
//! "Wrapping Operation").
//!
//! A NaN coordinate counts as 0; an infinite one saturates to the integer range, and the address
//! mode applies. Neither has a fraction.

use crate::machine::sampler::AddressMode;

/// The integer part and the fraction of a coordinate.
pub fn floor(coordinate: f32) -> (i64, f32) {
    let floor = coordinate.floor();
    let fraction = coordinate - floor;
    // `as` saturates, and converts NaN to 0.
    (i64::from(floor as i32), if fraction.is_nan() { 0.0 } else { fraction })
}

/// The layer that an array coordinate names: rounded to nearest even, clamped to the `count`
/// layers.
pub fn layer(coordinate: f32, count: u32) -> i64 {
    (coordinate.round_ties_even() as i64).clamp(0, i64::from(count) - 1)
}

/// Wraps a coordinate to an axis of `size` texels; `None` is the border.
pub fn wrap(mode: AddressMode, at: i64, size: u32) -> Option<i64> {
    let size = i64::from(size);
    match mode {
        AddressMode::Repeat => Some(at.rem_euclid(size)),
        AddressMode::MirroredRepeat => Some(size - 1 - mirror(at.rem_euclid(2 * size) - size)),
        AddressMode::ClampToEdge => Some(at.clamp(0, size - 1)),
        AddressMode::ClampToBorder => (0..size).contains(&at).then_some(at),
        AddressMode::MirrorClampToEdge => Some(mirror(at).clamp(0, size - 1)),
    }
}

fn mirror(at: i64) -> i64 {
    if at >= 0 { at } else { -(1 + at) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(mode: AddressMode) -> Vec<i64> {
        (-5..8).map(|at| wrap(mode, at, 3).unwrap_or(-1)).collect()
    }

    #[test]
    fn each_mode_at_and_beyond_the_edges() {
        //                                       -5 -4 -3 -2 -1  0  1  2  3  4  5  6  7
        assert_eq!(row(AddressMode::Repeat), [1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]);
        assert_eq!(row(AddressMode::MirroredRepeat), [1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
        assert_eq!(row(AddressMode::ClampToEdge), [0, 0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2, 2]);
        assert_eq!(row(AddressMode::ClampToBorder), [-1, -1, -1, -1, -1, 0, 1, 2, -1, -1, -1, -1, -1]);
        assert_eq!(row(AddressMode::MirrorClampToEdge), [2, 2, 2, 1, 0, 0, 1, 2, 2, 2, 2, 2, 2]);
    }

    #[test]
    fn nan_and_infinite_coordinates_have_texels() {
        assert_eq!(floor(f32::NAN), (0, 0.0));
        assert_eq!(floor(f32::INFINITY), (i64::from(i32::MAX), 0.0));
        assert_eq!(floor(-1e30), (i64::from(i32::MIN), 0.0));
        assert_eq!(floor(-0.25), (-1, 0.75));
        assert_eq!(floor(3.0), (3, 0.0));
        for mode in [AddressMode::Repeat, AddressMode::MirroredRepeat, AddressMode::MirrorClampToEdge] {
            for at in [i64::from(i32::MIN) - 9, i64::from(i32::MAX) + 9] {
                assert!((0..3).contains(&wrap(mode, at, 3).unwrap()));
            }
        }
    }

    #[test]
    fn layers_round_to_even_and_clamp() {
        let layers = [-1.0, 0.5, 1.5, 2.4, 2.6, 9.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        assert_eq!(layers.map(|at| layer(at, 4)), [0, 0, 2, 2, 3, 3, 0, 3, 0]);
    }
}
