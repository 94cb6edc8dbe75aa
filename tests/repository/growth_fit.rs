//! The fit of `cargo bench --bench growth`, on costs whose growth is known.

#[path = "../../benches/growth/fit.rs"]
mod fit;

use fit::{Growth, exponent_above_fixed_cost, exponent_of_peaks, slope};

fn points(cost: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    [100.0, 400.0, 1600.0, 6400.0].map(|n| (n, cost(n))).to_vec()
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9, "{found}, expected {expected}");
}

#[test]
fn a_power_has_its_exponent() {
    for exponent in [0.0, 0.5, 1.0, 1.5, 2.0] {
        near(slope(&points(|n| 3.0 * n.powf(exponent))), exponent);
    }
}

#[test]
fn a_fixed_cost_leaves_a_linear_exponent_at_1() {
    for fixed in [0.0, 10.0, 1e3] {
        near(exponent_above_fixed_cost(&points(|n| fixed + 2.0 * n)), 1.0);
    }
}

#[test]
fn a_fixed_cost_hides_no_square() {
    // The growths 15, 255 and 4095 over 3, 15 and 63 times the first size, whose logarithms to
    // base 2 are 3.907, 7.994, 12.000 and 1.585, 3.907, 5.977: differences from their means
    // (-4.060, 0.027, 4.033) and (-2.238, 0.084, 2.154), slope 17.78 / 9.656 = 1.841.
    let square = |fixed: f64| exponent_above_fixed_cost(&points(|n| fixed + n * n));
    assert!((square(0.0) - 1.841).abs() < 2e-3, "{}", square(0.0));
    near(square(2e4), square(0.0));
    assert!(square(1e4) > Growth::Linear.limit());
}

#[test]
fn noise_around_a_constant_is_no_growth() {
    // Only the last point has grown by more than a quarter: the slope is that of all four.
    let noisy = [(100.0, 1.0), (400.0, 1.1), (1600.0, 0.95), (6400.0, 1.3)];
    near(exponent_above_fixed_cost(&noisy), slope(&noisy));
    near(slope(&points(|_| 7.0)), 0.0);
    near(slope(&points(|_| 0.0)), 0.0);
}

#[test]
fn a_logarithm_is_below_its_limit_and_a_root_above_the_constant_one() {
    assert!(slope(&points(f64::ln)) < Growth::Logarithmic.limit());
    assert!(slope(&points(f64::sqrt)) > Growth::Constant.limit());
    assert!(exponent_above_fixed_cost(&points(|n| n * n.ln())) < Growth::Linear.limit());
}

#[test]
fn peaks_below_the_floor_are_no_part_of_the_slope() {
    // A start of 1,000 bytes, and 3 n bytes of work at another time.
    let peaks = points(|n| (3.0 * n).max(1000.0));
    assert!(slope(&peaks) < 0.8);
    near(exponent_of_peaks(&peaks, 1000.0), 1.0);
    near(exponent_of_peaks(&points(|_| 1000.0), 1000.0), 0.0);
    near(exponent_of_peaks(&points(|n| n * n), 0.0), 2.0);
}

#[test]
fn each_growth_has_a_name() {
    let names = [Growth::Constant, Growth::Logarithmic, Growth::Linear].map(Growth::name);
    assert_eq!(names, ["constant", "logarithmic", "linear"]);
}

#[test]
fn one_point_has_no_slope() {
    near(slope(&[(4.0, 2.0)]), 0.0);
    near(exponent_above_fixed_cost(&[(4.0, 2.0)]), 0.0);
}
