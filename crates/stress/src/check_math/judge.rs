//! Decides whether a result is correct: formats, rounding boundaries, and the two evaluations.

use crate::check_math::float_width::{Big, FloatWidth, big};
use crate::check_math::function::{CheckedFunction, ReferenceValue};

/// How far an evaluation in f64 may be off, relatively. The platform's functions are off by a few
/// units in the last place, 2^-52; this leaves a factor of more than a hundred.
const MARGIN: f64 = 1.0 / (1u64 << 44) as f64;

/// A value nearer than this, relatively, to the middle of two numbers of the format is this middle:
/// a power with exact operands cannot come so near and be another number.
const MIDPOINT_TOLERANCE: i32 = -150;

/// The greatest error of a function of f64, in units in the last place.
const ULPS: f64 = 1.0;

/// The verdict on a result.
#[derive(Clone, Debug, PartialEq)]
pub enum Judgement {
    /// The result is correct, as an evaluation in f64 decides.
    Correct,
    /// The result is correct, as arbitrary precision decides; the error in units in the last place
    /// (f64 only).
    Precise(f64),
    /// The result is wrong; the correct one.
    Wrong(String),
}

impl CheckedFunction {
    /// Judges a result.
    pub fn judge(&self, format: FloatWidth, operands: &[u64; 2], result: u64) -> Judgement {
        let [a, b] = operands.map(|bits| format.value(bits));
        let (estimate, exact) = match self.reference {
            ReferenceValue::Rounded(value) => (value(a), true),
            ReferenceValue::RoundedPair(value) => (value(a, b), true),
            ReferenceValue::Elementary(estimate, _) => (estimate(a), false),
            ReferenceValue::ElementaryPair(estimate, _) => (estimate(a, b), false),
            ReferenceValue::Integer { signed, bits } => return judge_integer(a, signed, bits, result),
        };
        if estimate.is_nan() {
            let right = format.value(result).is_nan();
            return if right { Judgement::Correct } else { Judgement::Wrong("NaN".into()) };
        }
        // Zeros and infinities are exact, or far beyond what the format has.
        if exact || (format != FloatWidth::Double && (estimate == 0.0 || estimate.is_infinite())) {
            return same(format, result, format.bits_of(estimate));
        }
        if format == FloatWidth::Double {
            return self.judge_double([a, b], estimate, f64::from_bits(result));
        }
        let low = format.bits_of(estimate * (1.0 - MARGIN));
        let high = format.bits_of(estimate * (1.0 + MARGIN));
        if low == high {
            return same(format, result, low);
        }
        judge_precise(format, &self.precise(a, b), result)
    }

    fn precise(&self, a: f64, b: f64) -> Big {
        match self.reference {
            ReferenceValue::Elementary(_, precise) => precise(&big(a)),
            ReferenceValue::ElementaryPair(_, precise) => precise(&big(a), &big(b)),
            _ => unreachable!(
                "bug in anyhit: arbitrary precision is requested for a function that f64 decides"
            ),
        }
    }

    /// At most one unit in the last place from the value, which near the ends of the range the
    /// estimate may have missed.
    fn judge_double(&self, [a, b]: [f64; 2], estimate: f64, result: f64) -> Judgement {
        const LEAST: f64 = f64::from_bits(1);
        let edge = matches!(self.reference, ReferenceValue::ElementaryPair(..)) && (a == 0.0 || b == 0.0);
        let near = match estimate {
            0.0 => Some(result.abs() <= LEAST),
            _ if estimate.is_infinite() => {
                Some(result.abs() >= f64::MAX && result.signum() == estimate.signum())
            }
            _ if result.is_infinite() => {
                Some(estimate.abs() == f64::MAX && result.signum() == estimate.signum())
            }
            _ if result.is_nan() => Some(false),
            // Of the arc tangent of two, a fraction of pi; of a power, 1.
            _ if edge || !(a.is_finite() && b.is_finite()) => {
                Some(result.to_bits().abs_diff(estimate.to_bits()) <= 1)
            }
            _ => None,
        };
        match near {
            Some(true) => return Judgement::Correct,
            Some(false) => return Judgement::Wrong(format!("about {estimate:e}")),
            None => {}
        }
        let value = self.precise(a, b);
        let exponent = ((estimate.abs().to_bits() >> 52) as i32 - 1023).max(-1022);
        let ulp = big(2.0).powi((exponent - 52).into());
        let error = ((value.clone() - big(result)) / ulp).to_f64().value().abs();
        // A value below the normal numbers may be 0, but not of the other sign.
        let signs = result == 0.0 || (result < 0.0) == (value < Big::ZERO);
        if error <= ULPS && signs {
            Judgement::Precise(error)
        } else {
            Judgement::Wrong(format!("{value} ({error} ulp)"))
        }
    }
}

/// Judges a conversion to an integer. Every value of every such type is one of i128.
fn judge_integer(value: f64, signed: bool, bits: u32, result: u64) -> Judgement {
    let (least, greatest) =
        if signed { (-(1i128 << (bits - 1)), (1 << (bits - 1)) - 1) } else { (0, (1i128 << bits) - 1) };
    let right = (value as i128).clamp(least, greatest);
    let mask = u64::MAX >> (64 - bits);
    let same = (right as u64 ^ result) & mask == 0;
    if same { Judgement::Correct } else { Judgement::Wrong(right.to_string()) }
}

/// Compares the bits of a result with the correct ones.
fn same(format: FloatWidth, result: u64, right: u64) -> Judgement {
    if result == right {
        return Judgement::Correct;
    }
    Judgement::Wrong(format!("{:e} = {right:#x}", format.value(right)))
}

/// Whether a result is the number of the format nearest to a value, by the middles between the
/// result and its neighbours.
fn judge_precise(format: FloatWidth, value: &Big, result: u64) -> Judgement {
    let magnitude = result & (format.sign() - 1);
    let negative = result & format.sign() != 0;
    let size = if *value < Big::ZERO { -value.clone() } else { value.clone() };
    let wrong = || Judgement::Wrong(format!("the nearest to {value}"));
    if magnitude > format.infinity() || negative != (*value < Big::ZERO) {
        return wrong();
    }
    let middle = |bits: u64| (format.magnitude(bits) + format.magnitude(bits + 1)) / 2.0;
    let even = magnitude.is_multiple_of(2);
    let below = magnitude == 0 || !is_below(&size, middle(magnitude - 1), even);
    // The neighbour above is even where the result is not.
    let above = magnitude == format.infinity() || is_below(&size, middle(magnitude), !even);
    if below && above { Judgement::Precise(0.0) } else { wrong() }
}

/// Whether a value lies below a middle, clearly; at the middle itself, whether the number above it
/// is not the even one.
fn is_below(value: &Big, middle: f64, above_is_even: bool) -> bool {
    if is_midpoint(value, middle) { !above_is_even } else { *value < big(middle) }
}

fn is_midpoint(value: &Big, middle: f64) -> bool {
    let middle = big(middle);
    let difference = value.clone() - middle.clone();
    let difference = if difference < Big::ZERO { -difference } else { difference };
    difference < middle * big(2.0).powi(MIDPOINT_TOLERANCE.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_rounded_to_nearest_even() {
        let bits = |value: f64| FloatWidth::Half.bits_of(value);
        // 1 + 2^-11 is a tie; 65520 is the tie between the largest number and 65536.
        assert_eq!(
            [bits(1.0), bits(1.0 + 2f64.powi(-11)), bits(1.0 + 3.0 * 2f64.powi(-11))],
            [0x3C00, 0x3C00, 0x3C02]
        );
        assert_eq!([bits(65_519.9), bits(65_520.0), bits(-1e9)], [0x7BFF, 0x7C00, 0xFC00]);
        assert_eq!(
            [bits(2f64.powi(-24)), bits(2f64.powi(-25)), bits(-0.0), bits(2f64.powi(-14))],
            [1, 0, 0x8000, 0x400]
        );
        for number in 0..=0xFFFF {
            let value = FloatWidth::Half.value(number);
            assert!(value.is_nan() || bits(value) == number, "{number:#x}");
        }
    }

    #[test]
    fn the_nearest_number_and_no_other_is_right() {
        // 1 + 2^-24 is the middle of 1 and its successor: 1 is the even one. A little more is
        // not 1.
        let tie = big(1.0 + 2f64.powi(-24));
        let more = tie.clone() + big(2.0).powi((-100).into());
        let less = tie.clone() - big(2.0).powi((-100).into());
        let right = |value: &Big, bits| {
            matches!(judge_precise(FloatWidth::Single, value, bits), Judgement::Precise(_))
        };
        assert_eq!([right(&tie, 0x3F80_0000), right(&tie, 0x3F80_0001)], [true, false]);
        assert_eq!([right(&more, 0x3F80_0000), right(&more, 0x3F80_0001)], [false, true]);
        assert_eq!([right(&less, 0x3F80_0000), right(&less, 0x3F80_0001)], [true, false]);
        // The next tie rounds up to the even one.
        let tie = big(1.0 + 3.0 * 2f64.powi(-24));
        assert_eq!([right(&tie, 0x3F80_0001), right(&tie, 0x3F80_0002)], [false, true]);
        // Beyond the largest number, and half of the smallest.
        let largest = f64::from(f32::MAX);
        assert!(right(&big(largest * (1.0 + 2f64.powi(-26))), 0x7F7F_FFFF));
        assert!(right(&big(2f64.powi(128)), 0x7F80_0000) && !right(&big(2f64.powi(128)), 0x7F7F_FFFF));
        assert!(right(&big(2f64.powi(-150)), 0) && !right(&big(2f64.powi(-150)), 1));
        assert!(right(&-big(2f64.powi(-148)), 0x8000_0002) && !right(&-big(2f64.powi(-148)), 2));
    }
}
