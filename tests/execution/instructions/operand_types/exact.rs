//! Floats by arbitrary precision: exact rationals, rounded once to the nearest, ties to even
//! (IEEE 754). NaNs are one value.

use num_bigint::{BigInt, Sign};

use crate::execution::instructions::operand_types::types::Kind;

/// What the bits of a float mean.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    NaN,
    /// With its sign.
    Infinity(bool),
    /// With its sign.
    Zero(bool),
    /// A number that is not zero.
    Number(Rational),
}

/// A quotient, the divisor above zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Rational {
    pub over: BigInt,
    pub under: BigInt,
}

/// Bits of the significand behind the point, and the greatest exponent.
fn format(kind: Kind) -> (i64, i64) {
    match kind {
        Kind::F16 => (10, 15),
        Kind::F32 => (23, 127),
        _ => (52, 1023),
    }
}

/// Two to a power.
fn power(exponent: i64) -> Rational {
    let one = BigInt::from(1);
    let (over, under) = match exponent {
        0.. => (one.clone() << exponent, one),
        _ => (one.clone(), one << -exponent),
    };
    Rational { over, under }
}

impl Rational {
    pub fn integer(value: i128) -> Self {
        Self { over: value.into(), under: 1.into() }
    }
    fn times(&self, other: &Self) -> Self {
        Self { over: &self.over * &other.over, under: &self.under * &other.under }
    }
    fn plus(&self, other: &Self) -> Self {
        Self {
            over: &self.over * &other.under + &other.over * &self.under,
            under: &self.under * &other.under,
        }
    }
    fn is_negative(&self) -> bool {
        self.over.sign() == Sign::Minus
    }
}

/// The meaning of bits.
pub fn read(kind: Kind, bits: u64) -> Value {
    let (fraction, bias) = format(kind);
    let negative = bits >> (kind.bits() - 1) & 1 == 1;
    let exponent = (bits >> fraction) as i64 & (2 * bias + 1);
    let mantissa = bits & ((1 << fraction) - 1);
    if exponent == 2 * bias + 1 {
        return if mantissa == 0 { Value::Infinity(negative) } else { Value::NaN };
    }
    if exponent == 0 && mantissa == 0 {
        return Value::Zero(negative);
    }
    let (significand, exponent) = match exponent {
        0 => (mantissa, 1 - bias - fraction),
        _ => (mantissa | 1 << fraction, exponent - bias - fraction),
    };
    let sign = if negative { -1 } else { 1 };
    Value::Number(Rational::integer(i128::from(significand) * sign).times(&power(exponent)))
}

/// The bits of a value, rounded to the nearest, ties to even; of a NaN those that all NaNs have
/// here.
pub fn round(kind: Kind, value: &Value) -> u64 {
    let (fraction, bias) = format(kind);
    let sign = |negative: bool| u64::from(negative) << (kind.bits() - 1);
    let infinity = ((2 * bias + 1) as u64) << fraction;
    let number = match value {
        Value::NaN => return infinity | 1 << (fraction - 1),
        Value::Infinity(negative) => return sign(*negative) | infinity,
        Value::Zero(negative) => return sign(*negative),
        Value::Number(number) => number,
    };
    let negative = number.is_negative();
    let over: BigInt = BigInt::from(number.over.magnitude().clone());
    // The exponent of the leading bit, then that of the last bit kept.
    let mut exponent = over.bits() as i64 - number.under.bits() as i64;
    let at_least = |exponent: i64| {
        let limit = power(exponent);
        &over * &limit.under >= &number.under * &limit.over
    };
    // It is this one or the one below, as both numbers lie within a factor of two of their lengths.
    if !at_least(exponent) {
        exponent -= 1;
    }
    if exponent > bias {
        return sign(negative) | infinity;
    }
    let last = exponent.max(1 - bias) - fraction;
    let scale = power(-last);
    let (over, under) = (over * scale.over, &number.under * scale.under);
    let (mut units, rest): (BigInt, BigInt) = (&over / &under, &over % &under);
    let twice: BigInt = rest * 2;
    let odd = units.bit(0);
    if twice > under || (twice == under && odd) {
        units += 1;
    }
    // Units of the last bit count on into the exponent, as IEEE 754 lays the fields out.
    let units = u64::try_from(units).expect("few bits");
    let stored = (last + fraction - (1 - bias)) as u64;
    let bits = (stored << fraction) + units;
    sign(negative) | bits.min(infinity)
}

/// The nearest of a kind to a number.
pub fn of_f64(kind: Kind, value: f64) -> u64 {
    if kind == Kind::F64 && !value.is_nan() {
        return value.to_bits();
    }
    round(kind, &read(Kind::F64, value.to_bits()))
}

/// The value in f64, which holds all of f16 and f32.
pub fn to_f64(kind: Kind, bits: u64) -> f64 {
    match kind {
        Kind::F64 => return f64::from_bits(bits),
        Kind::F32 => return f32::from_bits(bits as u32).into(),
        _ => {}
    }
    f64::from_bits(round(Kind::F64, &read(kind, bits)))
}

fn is_negative(value: &Value) -> bool {
    match value {
        Value::NaN => false,
        Value::Infinity(negative) | Value::Zero(negative) => *negative,
        Value::Number(number) => number.is_negative(),
    }
}

fn negated(value: Value) -> Value {
    match value {
        Value::NaN => Value::NaN,
        Value::Infinity(negative) => Value::Infinity(!negative),
        Value::Zero(negative) => Value::Zero(!negative),
        Value::Number(number) => Value::Number(Rational { over: -number.over, under: number.under }),
    }
}

fn sum(a: Value, b: Value) -> Value {
    match (a, b) {
        (Value::NaN, _) | (_, Value::NaN) => Value::NaN,
        (Value::Infinity(a), Value::Infinity(b)) if a != b => Value::NaN,
        (Value::Infinity(a), _) | (_, Value::Infinity(a)) => Value::Infinity(a),
        (Value::Zero(a), Value::Zero(b)) => Value::Zero(a && b),
        (Value::Zero(_), other) | (other, Value::Zero(_)) => other,
        (Value::Number(a), Value::Number(b)) => match a.plus(&b) {
            sum if sum.over.sign() == Sign::NoSign => Value::Zero(false),
            sum => Value::Number(sum),
        },
    }
}

fn product(a: Value, b: Value) -> Value {
    let negative = is_negative(&a) != is_negative(&b);
    match (a, b) {
        (Value::NaN, _) | (_, Value::NaN) => Value::NaN,
        (Value::Infinity(_), Value::Zero(_)) | (Value::Zero(_), Value::Infinity(_)) => Value::NaN,
        (Value::Infinity(_), _) | (_, Value::Infinity(_)) => Value::Infinity(negative),
        (Value::Zero(_), _) | (_, Value::Zero(_)) => Value::Zero(negative),
        (Value::Number(a), Value::Number(b)) => Value::Number(a.times(&b)),
    }
}

fn quotient(a: Value, b: Value) -> Value {
    let negative = is_negative(&a) != is_negative(&b);
    match (a, b) {
        (Value::NaN, _) | (_, Value::NaN) => Value::NaN,
        (Value::Infinity(_), Value::Infinity(_)) | (Value::Zero(_), Value::Zero(_)) => Value::NaN,
        (Value::Infinity(_), _) | (_, Value::Zero(_)) => Value::Infinity(negative),
        (Value::Zero(_), _) | (_, Value::Infinity(_)) => Value::Zero(negative),
        (Value::Number(a), Value::Number(b)) => {
            let sign = if b.is_negative() { -1 } else { 1 };
            let inverse = Rational { over: b.under * sign, under: b.over * sign };
            Value::Number(a.times(&inverse))
        }
    }
}

pub fn negate(kind: Kind, a: u64) -> u64 {
    round(kind, &negated(read(kind, a)))
}

pub fn add(kind: Kind, a: u64, b: u64) -> u64 {
    round(kind, &sum(read(kind, a), read(kind, b)))
}

pub fn sub(kind: Kind, a: u64, b: u64) -> u64 {
    round(kind, &sum(read(kind, a), negated(read(kind, b))))
}

pub fn mul(kind: Kind, a: u64, b: u64) -> u64 {
    round(kind, &product(read(kind, a), read(kind, b)))
}

pub fn div(kind: Kind, a: u64, b: u64) -> u64 {
    round(kind, &quotient(read(kind, a), read(kind, b)))
}

/// `a * b + c`, rounded once.
pub fn fma(kind: Kind, a: u64, b: u64, c: u64) -> u64 {
    round(kind, &sum(product(read(kind, a), read(kind, b)), read(kind, c)))
}

/// Times two to a power, rounded once.
pub fn scale(kind: Kind, a: u64, exponent: i128) -> u64 {
    // Beyond the range of f64 twice over, nothing changes any more.
    let exponent = exponent.clamp(-5000, 5000) as i64;
    round(kind, &product(read(kind, a), Value::Number(power(exponent))))
}

/// An integer as a float.
pub fn of_integer(kind: Kind, value: i128) -> u64 {
    match value {
        0 => 0,
        _ => round(kind, &Value::Number(Rational::integer(value))),
    }
}

/// A float without its fraction; `None` for what is no number.
pub fn truncated(kind: Kind, bits: u64) -> Option<BigInt> {
    match read(kind, bits) {
        Value::Zero(_) => Some(0.into()),
        Value::Number(number) => Some(number.over / number.under),
        _ => None,
    }
}
