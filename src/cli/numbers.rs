//! Numbers of the command line: what a flag cannot mean is refused where it is parsed.

use std::ops::Range;
use std::time::Duration;

use anyhit_base::error::{Error, ErrorKind};

/// A whole number from 1 on.
///
/// # Errors
/// A message for anything else, 0 among it.
pub(super) fn from_one(text: &str) -> Result<u64, String> {
    text.parse()
        .ok()
        .filter(|&number| number > 0)
        .ok_or_else(|| format!("expected an integer from 1 to {}", u64::MAX))
}

/// [`from_one`] in 32 bits.
///
/// # Errors
/// As [`from_one`].
pub(super) fn from_one_u32(text: &str) -> Result<u32, String> {
    text.parse()
        .ok()
        .filter(|&number| number > 0)
        .ok_or_else(|| format!("expected an integer from 1 to {}", u32::MAX))
}

/// The size of a subgroup: a power of two from 1 to 128.
///
/// # Errors
/// A message for anything else.
pub(super) fn subgroup_size(text: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|number: &u32| number.is_power_of_two() && *number <= 128);
    number.ok_or_else(|| "expected a power of two from 1 to 128".to_owned())
}

/// A finite number above 0.
///
/// # Errors
/// A message for anything else.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "expected a finite number above 0".to_owned())
}

/// A finite number from 0 on.
///
/// # Errors
/// A message for anything else.
pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number >= 0.0);
    number.ok_or_else(|| "expected a finite number, 0 or greater".to_owned())
}

/// A number of an f32 that is no NaN; it may be infinite.
///
/// # Errors
/// A message for anything else, and for a finite number that an f32 cannot hold.
pub(super) fn float(text: &str) -> Result<f32, String> {
    let number: Option<f32> = text.parse().ok().filter(|number: &f32| !number.is_nan());
    match number {
        Some(number) if number.is_infinite() && text.contains(|digit: char| digit.is_ascii_digit()) => {
            Err("the number is out of range for an f32; write `inf` for infinity".to_owned())
        }
        Some(number) => Ok(number),
        None => Err("expected a number".to_owned()),
    }
}

/// A time of a ray, from 0 to 1.
///
/// # Errors
/// A message for anything else.
pub(super) fn ray_time(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|number| (0.0..=1.0).contains(number));
    number
        .ok_or_else(|| "expected a time from 0 to 1 (VUID-RuntimeSpirv-OpTraceRayMotionNV-06366)".to_owned())
}

/// Seconds, above 0.
///
/// # Errors
/// A message for anything else, and for more seconds than a duration holds.
pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    duration(text, 1.0).ok_or_else(|| "expected a finite number of seconds above 0".to_owned())
}

/// Minutes, above 0.
///
/// # Errors
/// As [`seconds`].
#[cfg(feature = "stress")]
pub(super) fn minutes(text: &str) -> Result<Duration, String> {
    duration(text, 60.0).ok_or_else(|| "expected a finite number of minutes above 0".to_owned())
}

fn duration(text: &str, unit: f64) -> Option<Duration> {
    let seconds = positive(text).ok()? * unit;
    Duration::try_from_secs_f64(seconds).ok().filter(|duration| !duration.is_zero())
}

/// A range of seeds, `A..B`, that is not empty.
///
/// # Errors
/// A message for anything else.
pub(super) fn seed_range(text: &str) -> Result<Range<u64>, String> {
    let number = |text: &str| text.parse::<u64>().map_err(|error| format!("{text:?}: {error}"));
    let (first, end) = text.split_once("..").ok_or("expected A..B, such as 0..64")?;
    let (first, end) = (number(first)?, number(end)?);
    match first < end {
        true => Ok(first..end),
        false => Err(format!("the range A..B contains A to B - 1 and is empty: {first} is not below {end}")),
    }
}

/// The error of a range of which nothing is among what another flag counts.
pub(super) fn beyond(what: &str, range: &Range<u64>, flag: &str, count: u64) -> Error {
    let Range { start, end } = range;
    let message = format!(
        "`--seed-range {start}..{end}` contains no {what} of `{flag} {count}`, which are 0 to {}",
        count.saturating_sub(1)
    );
    Error::new(ErrorKind::InvalidArgument, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_or_refused() {
        assert_eq!((from_one("1"), from_one("18446744073709551615")), (Ok(1), Ok(u64::MAX)));
        assert_eq!(
            (from_one_u32("4294967295"), positive("0.5"), not_negative("0")),
            (Ok(u32::MAX), Ok(0.5), Ok(0.0))
        );
        for wrong in ["", "0", "-1", "1.5", "nan", "inf", "18446744073709551616", "x"] {
            assert!(from_one(wrong).is_err() && from_one_u32(wrong).is_err(), "{wrong}");
        }
        for wrong in ["", "-1", "nan", "inf", "-inf", "1e999", "x"] {
            assert!(
                positive(wrong).is_err() && not_negative(wrong).is_err() && seconds(wrong).is_err(),
                "{wrong}"
            );
        }
        assert!(positive("0").is_err() && positive("-0").is_err() && not_negative("-1e-9").is_err());
    }

    #[test]
    fn times_are_read_or_refused() {
        assert_eq!(seconds("0.25"), Ok(Duration::from_millis(250)));
        assert_eq!(minutes("1.5"), Ok(Duration::from_secs(90)));
        for wrong in ["0", "-0", "1e300", "1e-12", "-3", "soon"] {
            assert!(seconds(wrong).is_err() && minutes(wrong).is_err(), "{wrong}");
        }
        assert_eq!((ray_time("0"), ray_time("1")), (Ok(0.0), Ok(1.0)));
        for wrong in ["-0.1", "1.1", "nan", "inf", ""] {
            assert!(ray_time(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_float_may_be_infinite_where_that_is_meant() {
        assert_eq!(
            (float("-2.5"), float("inf"), float("-inf")),
            (Ok(-2.5), Ok(f32::INFINITY), Ok(f32::NEG_INFINITY))
        );
        for wrong in ["nan", "1e39", "-1e39", "", "x"] {
            assert!(float(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_range_of_seeds_has_a_seed() {
        assert_eq!(seed_range("0..1"), Ok(0..1));
        for wrong in ["", "3", "0..0", "4..4", "5..4", "-1..4", "a..b", "0..18446744073709551616", "0..=4"] {
            assert!(seed_range(wrong).is_err(), "{wrong}");
        }
    }
}
