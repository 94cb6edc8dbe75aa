//! The rule of docs/testing.md, "Value conversions", in rational numbers; it shares nothing with
//! the crate.

use dashu_base::BitTest;
use dashu_ratio::RBig;
use proptest::prelude::*;

/// A scalar type of a shader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    Integer { width: u32, signed: bool },
    Float(Format),
    Bool,
}

/// A format of floats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Format {
    pub width: u32,
    /// Bits of the significand without the leading one.
    pub significand: i64,
    /// The exponents of the least and of the greatest normal number.
    pub least: i64,
    pub greatest: i64,
    /// E4M3 has none, and one number more is its NaN.
    pub has_infinity: bool,
}

pub const fn integer(width: u32, signed: bool) -> Target {
    Target::Integer { width, signed }
}

const fn ieee(width: u32, significand: i64) -> Target {
    let greatest = (1 << (width as i64 - significand - 2)) - 1;
    Target::Float(Format { width, significand, least: 1 - greatest, greatest, has_infinity: true })
}

pub const HALF: Target = ieee(16, 10);
pub const FLOAT: Target = ieee(32, 23);
pub const DOUBLE: Target = ieee(64, 52);
pub const BFLOAT: Target = ieee(16, 7);
pub const E5M2: Target = ieee(8, 2);
pub const E4M3: Target =
    Target::Float(Format { width: 8, significand: 3, least: -6, greatest: 8, has_infinity: false });

/// A value, as it is given or as it is stored.
#[derive(Clone, Debug, PartialEq)]
pub enum Exact {
    Bool(bool),
    Integer(RBig),
    /// The sign counts for zeros.
    Float(RBig, bool),
    Infinity(bool),
    NaN,
    /// No scalar.
    Other,
}

pub fn two_to(exponent: i64) -> RBig {
    RBig::from(2u8).pow(exponent as isize)
}

fn is_negative(value: &RBig) -> bool {
    *value < RBig::ZERO
}

impl Exact {
    pub fn of_float(value: f64) -> Self {
        match value {
            _ if value.is_nan() => Self::NaN,
            _ if value.is_infinite() => Self::Infinity(value < 0.0),
            _ => Self::Float(RBig::try_from(value).expect("a finite number"), value.is_sign_negative()),
        }
    }

    /// The value that bits have in a type.
    pub fn of_bits(bits: u64, target: Target) -> Self {
        match target {
            Target::Bool => Self::Bool(bits != 0),
            Target::Integer { width, signed } => {
                let whole = i128::from(bits);
                let is_negative = signed && bits >> (width - 1) == 1;
                Self::Integer(RBig::from(if is_negative { whole - (1i128 << width) } else { whole }))
            }
            Target::Float(format) => {
                let negative = bits >> (format.width - 1) == 1;
                let fraction = bits & ((1 << format.significand) - 1);
                let exponent = (bits >> format.significand)
                    & ((1 << (i64::from(format.width) - 1 - format.significand)) - 1);
                let top = (1u64 << (i64::from(format.width) - 1 - format.significand)) - 1;
                match (exponent == top, format.has_infinity, fraction) {
                    (true, true, 0) => return Self::Infinity(negative),
                    (true, true, _) => return Self::NaN,
                    (true, false, 7) => return Self::NaN,
                    _ => {}
                }
                let (one, power) = match exponent {
                    0 => (0, format.least),
                    _ => (1u64 << format.significand, exponent as i64 - 1 + format.least),
                };
                let size = RBig::from(one + fraction) * two_to(power - format.significand);
                Self::Float(if negative { -size } else { size }, negative)
            }
        }
    }
}

/// The nearest number of a format, ties to even; `None` where it overflows or vanishes.
pub fn nearest(value: &RBig, format: Format) -> Option<RBig> {
    if *value == RBig::ZERO {
        return Some(RBig::ZERO);
    }
    let size = if is_negative(value) { -value.clone() } else { value.clone() };
    let bits = size.numerator().bit_len() as i64 - size.denominator().bit_len() as i64;
    // The binade, or the one below it.
    let binade = if two_to(bits) <= size { bits } else { bits - 1 };
    let step = two_to(binade.max(format.least) - format.significand);
    let (two, ratio) = (RBig::from(2u8), size / step.clone());
    let steps = RBig::from(ratio.floor());
    let rest = (ratio - steps.clone()) * two.clone();
    let is_odd = RBig::from((steps.clone() / two.clone()).floor()) * two != steps;
    let up = rest > RBig::ONE || rest == RBig::ONE && is_odd;
    let rounded = if up { steps + RBig::ONE } else { steps } * step;
    let last = two_to(format.greatest - format.significand);
    let most = two_to(format.greatest + 1) - if format.has_infinity { last } else { last * RBig::from(2u8) };
    if rounded > most || rounded == RBig::ZERO {
        return None;
    }
    Some(if is_negative(value) { -rounded } else { rounded })
}

/// What a value becomes in a type: `None` where it is refused. In scene files an integer becomes a
/// float that has it; the bools of a buffer are 32-bit integers.
pub fn rule(given: &Exact, target: Target, is_scene: bool, is_buffer: bool) -> Option<Exact> {
    match (target, given) {
        (Target::Bool, Exact::Bool(_)) => Some(given.clone()),
        (Target::Integer { width: 32, .. }, Exact::Bool(value)) if is_buffer => {
            Some(Exact::Integer(RBig::from(u8::from(*value))))
        }
        (Target::Integer { width, signed }, Exact::Integer(value)) => {
            let half = two_to(i64::from(width) - 1);
            let (least, end) = match signed {
                true => (-half.clone(), half),
                false => (RBig::ZERO, half.clone() + half),
            };
            (least <= *value && *value < end).then(|| given.clone())
        }
        (Target::Float(format), Exact::Integer(value)) if is_scene => {
            let rounded = nearest(value, format)?;
            (rounded == *value).then(|| Exact::Float(rounded, is_negative(value)))
        }
        (Target::Float(format), Exact::Float(value, negative)) => {
            Some(Exact::Float(nearest(value, format)?, *negative))
        }
        (Target::Float(format), Exact::Infinity(_)) => format.has_infinity.then(|| given.clone()),
        (Target::Float(_), Exact::NaN) => Some(Exact::NaN),
        _ => None,
    }
}

/// The value of a text of TOML, and whether it is an integer that is not decimal.
pub fn of_toml(text: &str) -> (Exact, bool) {
    let plain = text.replace('_', "");
    let digits = plain.trim_start_matches(['+', '-']);
    let negative = plain.starts_with('-');
    let radix = [("0x", 16), ("0o", 8), ("0b", 2)];
    if let Some((digits, radix)) =
        radix.iter().find_map(|(head, radix)| Some((digits.strip_prefix(head)?, radix)))
    {
        return (Exact::Integer(RBig::from(u128::from_str_radix(digits, *radix).expect("digits"))), true);
    }
    let value = match digits {
        "true" | "false" => Exact::Bool(digits == "true"),
        "inf" => Exact::Infinity(negative),
        "nan" => Exact::NaN,
        _ if digits.bytes().all(|byte| byte.is_ascii_digit()) => {
            let value = decimal(digits);
            Exact::Integer(if negative { -value } else { value })
        }
        // A date begins like a number, too.
        _ if digits.starts_with(|first: char| first.is_ascii_digit()) && digits.contains(['.', 'e', 'E']) => {
            let (significand, power) = digits.split_once(['e', 'E']).unwrap_or((digits, "0"));
            let (whole, fraction) = significand.split_once('.').unwrap_or((significand, ""));
            let power = power.parse::<isize>().expect("an exponent") - fraction.len() as isize;
            let value = decimal(&format!("{whole}{fraction}")) * RBig::from(10u8).pow(power);
            Exact::Float(if negative { -value } else { value }, negative)
        }
        _ => Exact::Other,
    };
    (value, false)
}

fn decimal(digits: &str) -> RBig {
    let ten = RBig::from(10u8);
    digits.bytes().fold(RBig::ZERO, |value, digit| value * ten.clone() + RBig::from(digit - b'0'))
}

/// Integers near the ends of types, in every spelling.
fn integers() -> impl Strategy<Value = String> {
    let near =
        (prop_oneof![Just(0u32), 2u32..18, 23u32..34, 52u32..66, 126u32..129], -2i128..3, any::<bool>());
    let near = near.prop_map(|(shift, delta, negative)| {
        let value = (1i128 << shift.min(126)) + delta;
        if negative { -value } else { value }
    });
    let value = prop_oneof![3 => near, 1 => any::<i64>().prop_map(i128::from), 1 => -300i128..300];
    (value, 0..8).prop_map(|(value, spelling)| match (spelling, value) {
        (0, 0..) => format!("+{value}"),
        (1, 0..) => format!("{value:#x}"),
        (2, 0..) => format!("{value:#o}"),
        (3, 0..) => format!("{value:#b}"),
        (4, _) if value.abs() > 9 => {
            let text = value.to_string();
            format!("{}_{}", &text[..text.len() - 1], &text[text.len() - 1..])
        }
        _ => value.to_string(),
    })
}

/// Floats near numbers of a few bits, and near the ties between them, in every spelling.
fn floats() -> impl Strategy<Value = String> {
    let edge = (-160i32..130, 0u64..64, 0i64..3, any::<bool>());
    let edge = edge.prop_map(|(exponent, steps, place, negative)| {
        // Ties of halves, bfloats and floats: few bits, at several places.
        let shift = [46, 41, 28][place as usize];
        let value = f64::from_bits((((i64::from(exponent) + 1023) as u64) << 52) | steps << shift);
        if negative { -value } else { value }
    });
    let far = (-1080i32..1024, -3i64..4).prop_map(|(exponent, ulps)| {
        f64::from_bits((2f64.powi(exponent).to_bits() as i64 + ulps).max(0) as u64)
    });
    let halves = (0u64..1 << 15, -3i64..4).prop_map(|(bits, ulps)| {
        // Half a step above a half, and nearby.
        let value = (bits % (1 << 11)) as f64 + 0.5;
        f64::from_bits(((value * 2f64.powi((bits >> 11) as i32 - 24)).to_bits() as i64 + ulps) as u64)
    });
    let value = prop_oneof![edge, far, halves, any::<f64>().prop_filter("finite", |value| value.is_finite())];
    (value, 0..9, 0usize..40).prop_map(|(value, spelling, zeros)| {
        let exact = format!("{value:.1074}");
        let exact = exact.trim_end_matches('0');
        let exact = if exact.ends_with('.') { format!("{exact}0") } else { exact.to_owned() };
        match spelling {
            0 => format!("{value:e}"),
            1 => format!("{value:E}"),
            2 => format!("{value:?}"),
            // A little above in magnitude, and a little below.
            3 | 4 => format!("{exact}{}1", "0".repeat(zeros)),
            5 | 6 => below(&exact, zeros),
            7 => format!("{exact}e+0"),
            _ => exact,
        }
    })
}

/// A text a little below another one, which has a point, in magnitude.
fn below(exact: &str, nines: usize) -> String {
    let Some(last) = exact.rfind(|c: char| ('1'..='9').contains(&c)) else { return exact.to_owned() };
    if last < exact.find('.').unwrap_or(0) {
        return exact.to_owned();
    }
    let digit = (exact.as_bytes()[last] - 1) as char;
    format!("{}{digit}{}", &exact[..last], "9".repeat(nines + 1))
}

/// Values of TOML, of which most are numbers.
pub fn values() -> impl Strategy<Value = String> {
    let words = prop::sample::select(vec![
        "true",
        "false",
        "inf",
        "+inf",
        "-inf",
        "nan",
        "+nan",
        "-nan",
        "0",
        "-0",
        "0.0",
        "-0.0",
        "+0.0",
        "1e400",
        "-1E+400",
        "1e-400",
        "5e-324",
        "2e-324",
        "1e22",
        "6.5E+4",
        "65519.999",
        "65520.0",
        "4.48e2",
        "464.0",
        "465.0",
        "1_000.5",
        "'1'",
        "\"\"",
        "[]",
        "[1]",
        "[1.0]",
        "{ a = 1 }",
        "1979-05-27",
        "340282346638528859811704183484516925440",
        "16777217.000000000000000000001",
        "16777217.0",
        "16777217",
        "2049",
        "257",
    ]);
    prop_oneof![4 => integers(), 5 => floats(), 2 => words.prop_map(str::to_owned)]
}
