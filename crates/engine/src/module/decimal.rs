//! Numbers as floats of any format, rounded once: from a decimal text, or from an f64. A number
//! that overflows, or that is not 0 and rounds to 0, is refused.

use std::cmp::Ordering;

use crate::math::float_format::FloatFormat;

/// Why a float format has no number that a value could become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FloatMisfit {
    /// It is beyond the largest number.
    Overflows,
    /// It is not 0, and rounds to 0.
    Vanishes,
    /// It is infinite, and the format has no infinity.
    NoInfinity,
    /// A whole number that the format lacks, and the nearest that it has.
    Inexact(f64),
    /// A text that is no number.
    NoNumber,
}

impl FloatMisfit {
    /// Why a type has no number that a text could become; `ty` with its article, if any.
    pub fn describe(self, number: &str, ty: &str) -> String {
        match self {
            Self::Overflows => format!("{number} is out of the range of {ty}"),
            Self::Vanishes => format!("{number} is too small for {ty}: it rounds to 0"),
            Self::NoInfinity => format!("{ty} has no infinity"),
            Self::Inexact(nearest) => {
                format!("{number} is not exactly representable as {ty}: the nearest value is {nearest}")
            }
            Self::NoNumber => format!("{number} is not a number"),
        }
    }
}

/// Returns the bits to which a value was rounded in a format.
///
/// # Errors
/// Where they are no rounding of the value, but the loss of it.
pub(crate) fn judge_rounding(value: f64, bits: u64, format: FloatFormat) -> Result<u64, FloatMisfit> {
    let rounded = format.value(bits);
    match () {
        () if value.is_finite() && !rounded.is_finite() => Err(FloatMisfit::Overflows),
        () if value.is_infinite() && !rounded.is_infinite() => Err(FloatMisfit::NoInfinity),
        () if value != 0.0 && rounded == 0.0 => Err(FloatMisfit::Vanishes),
        () => Ok(bits),
    }
}

/// The digits of a magnitude without zeros at either end, and the power of ten of the point before
/// the first: `0.DIGITS * 10^exponent`. Zero has no digits.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Magnitude {
    exponent: i64,
    digits: Vec<u8>,
}

impl Magnitude {
    fn of(text: &str) -> Self {
        let (significand, power) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
        // Beyond 18 digits an exponent only has to be large.
        let large = if power.starts_with('-') { i64::MIN / 4 } else { i64::MAX / 4 };
        let power: i64 = power.parse().unwrap_or(large).clamp(i64::MIN / 4, i64::MAX / 4);
        let significand = significand.trim_start_matches(['+', '-']);
        let (whole, fraction) = significand.split_once('.').unwrap_or((significand, ""));
        let mut digits: Vec<u8> = whole.bytes().chain(fraction.bytes()).collect();
        let zeros = digits.iter().take_while(|digit| **digit == b'0').count();
        digits.drain(..zeros);
        digits.truncate(digits.iter().rposition(|digit| *digit != b'0').map_or(0, |last| last + 1));
        if digits.is_empty() {
            return Self { exponent: i64::MIN, digits };
        }
        Self { exponent: power + whole.len() as i64 - zeros as i64, digits }
    }

    /// Of a finite number, exactly: no f64 has more digits behind the point.
    fn of_float(value: f64) -> Self {
        if value == 0.0 { Self::of("0") } else { Self::of(&format!("{:.1074}", value.abs())) }
    }
}

fn is_finite(text: &str) -> bool {
    !text.contains(['n', 'N'])
}

/// The number nearest to a text, but one that is as far from 0 and infinity as the text is; `None`
/// where it is no number.
pub fn decimal_value(text: &str) -> Option<f64> {
    let nearest: f64 = text.parse().ok()?;
    let is_lost = is_finite(text)
        && (nearest.is_infinite() || nearest == 0.0 && !Magnitude::of(text).digits.is_empty());
    Some(if is_lost { rounded_to_odd(text, nearest) } else { nearest })
}

/// The text's value as an f64, whose last bit is set where digits are lost: rounded again, to a
/// format of at most 51 bits, it becomes what the text itself rounds to.
fn rounded_to_odd(text: &str, nearest: f64) -> f64 {
    if nearest.is_infinite() {
        return f64::MAX.copysign(nearest);
    }
    let bits = nearest.abs().to_bits();
    let bits = match Magnitude::of(text).cmp(&Magnitude::of_float(nearest)) {
        Ordering::Equal => bits,
        Ordering::Greater => bits | 1,
        Ordering::Less => bits.saturating_sub(1) | 1,
    };
    f64::from_bits(bits).copysign(nearest)
}

/// The bits of the nearest number of a format, ties to even.
///
/// # Errors
/// Where it overflows, or is not 0 and rounds to 0, or the text is no number.
pub fn decimal_bits(text: &str, format: FloatFormat) -> Result<u64, FloatMisfit> {
    let value = decimal_value(text).ok_or(FloatMisfit::NoNumber)?;
    if format == FloatFormat::Binary64 {
        let nearest: f64 = text.parse().map_err(|_| FloatMisfit::NoNumber)?;
        return judge_rounding(value, nearest.to_bits(), format);
    }
    let bits = format.round(value);
    let is_far_from_ties = format.round(value.next_down()) == format.round(value.next_up());
    if !value.is_finite() || value == 0.0 || is_far_from_ties {
        return judge_rounding(value, bits, format);
    }
    let value = rounded_to_odd(text, value);
    judge_rounding(value, format.round(value), format)
}

/// The bits of a whole number, given by its decimal digits, in a format.
///
/// # Errors
/// As [`decimal_bits`], and where the format lacks the number.
pub fn whole_bits(digits: &str, format: FloatFormat) -> Result<u64, FloatMisfit> {
    let bits = decimal_bits(digits, format)?;
    let found = format.value(bits);
    match Magnitude::of(digits) == Magnitude::of_float(found) {
        true => Ok(bits),
        false => Err(FloatMisfit::Inexact(found)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_rounded_once() {
        // 1 + 2^-11 is the tie between 1 and 1 + 2^-10 of a half.
        let tie = "1.00048828125";
        for (text, bits) in [(tie, 0x3C00), (&*format!("{tie}{}1", "0".repeat(900)), 0x3C01)] {
            assert_eq!(decimal_bits(text, FloatFormat::Binary16), Ok(bits), "{text}");
        }
        // Below the next tie, 1 + 3 * 2^-11, by less than an f64 holds.
        assert_eq!(decimal_bits("1.00146484374999999999999999", FloatFormat::Binary16), Ok(0x3C01));
        assert_eq!(decimal_bits("1.00146484375", FloatFormat::Binary16), Ok(0x3C02));
        assert_eq!(decimal_bits("16777217.00000000000001", FloatFormat::Binary32), Ok(0x4B80_0001));
        assert_eq!(decimal_bits("-0.0", FloatFormat::Binary32), Ok(0x8000_0000));
        assert_eq!(decimal_bits("65519.99999999999999999999", FloatFormat::Binary16), Ok(0x7BFF));
        assert_eq!(decimal_bits("inf", FloatFormat::Binary64), Ok(f64::INFINITY.to_bits()));
    }

    #[test]
    fn numbers_beyond_any_float_are_lost() {
        for format in [FloatFormat::Binary64, FloatFormat::Binary32, FloatFormat::E5M2] {
            assert_eq!(decimal_bits("1e-400", format), Err(FloatMisfit::Vanishes));
            assert_eq!(decimal_bits("-1e400", format), Err(FloatMisfit::Overflows));
            assert_eq!(decimal_bits("1e-99999999999999999999", format), Err(FloatMisfit::Vanishes));
            assert_eq!(decimal_bits("0e99999999999999999999", format), Ok(0));
        }
    }

    #[test]
    fn whole_numbers_are_exact() {
        assert_eq!(whole_bits("2048", FloatFormat::Binary16), Ok(0x6800));
        assert_eq!(whole_bits("2049", FloatFormat::Binary16), Err(FloatMisfit::Inexact(2048.0)));
        let greatest = "340282346638528859811704183484516925440";
        assert_eq!(whole_bits(greatest, FloatFormat::Binary32), Ok(0x7F7F_FFFF));
        assert_eq!(whole_bits("-9007199254740994", FloatFormat::Binary64), Ok(0xC340_0000_0000_0001));
        let nearest = FloatMisfit::Inexact(9007199254740992.0);
        assert_eq!(whole_bits("9007199254740993", FloatFormat::Binary64), Err(nearest));
    }
}
