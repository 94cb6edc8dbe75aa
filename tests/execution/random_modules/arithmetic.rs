//! What instructions say about scalars, from the specification: integers as numbers modulo a power
//! of two, floats rounded once. A result of `None` is one that the specification does not define.

use rspirv::spirv::{GlslStd450Op as GLOp, Op};

/// The number that the lowest bits stand for.
pub fn signed(bits: u64, width: u32) -> i128 {
    let bits = bits & mask(width);
    if bits >> (width - 1) & 1 == 1 { i128::from(bits) - (1 << width) } else { bits.into() }
}

/// Whether the bits are those of a subnormal float.
pub fn is_subnormal(bits: u64, width: u32) -> bool {
    let fraction = match width {
        16 => 10,
        32 => 23,
        _ => 52,
    };
    let magnitude = bits & mask(width - 1);
    magnitude != 0 && magnitude < 1 << fraction
}

pub fn mask(width: u32) -> u64 {
    u64::MAX >> (64 - width)
}

/// The value of a float's bits; every f16 and every f32 is an f64.
pub fn float(bits: u64, width: u32) -> f64 {
    match width {
        16 => {
            let (exponent, fraction) = (bits >> 10 & 31, (bits & 1023) as f64);
            let magnitude = match exponent {
                31 if fraction == 0.0 => f64::INFINITY,
                31 => f64::NAN,
                0 => fraction * 2f64.powi(-24),
                _ => (1024.0 + fraction) * 2f64.powi(exponent as i32 - 25),
            };
            if bits >> 15 & 1 == 1 { -magnitude } else { magnitude }
        }
        32 => f64::from(f32::from_bits(bits as u32)),
        _ => f64::from_bits(bits),
    }
}

/// The bits of the float nearest to a value, even where two are; a value that is not exact must not
/// be closer to the middle of two than its own last bit.
pub fn rounded(value: f64, width: u32) -> u64 {
    match width {
        16 => {
            let sign = u64::from(value.is_sign_negative()) << 15;
            let magnitude = value.abs();
            if value.is_nan() {
                0x7E00
            } else if magnitude >= 65_520.0 {
                sign | 0x7C00
            } else if magnitude < 2f64.powi(-14) {
                sign | (magnitude * 2f64.powi(24)).round_ties_even() as u64
            } else {
                let exponent = (magnitude.to_bits() >> 52) as i32 - 1023;
                let fraction = (magnitude * 2f64.powi(10 - exponent)).round_ties_even() as u64;
                sign | ((((exponent + 15) as u64) << 10) + (fraction - 1024))
            }
        }
        32 => (value as f32).to_bits().into(),
        _ => value.to_bits(),
    }
}

/// a * b + c, rounded once.
pub fn fused(a: u64, b: u64, c: u64, width: u32) -> u64 {
    match width {
        32 => {
            let [a, b, c] = [a, b, c].map(|bits| f32::from_bits(bits as u32));
            a.mul_add(b, c).to_bits().into()
        }
        64 => f64::from_bits(a).mul_add(f64::from_bits(b), f64::from_bits(c)).to_bits(),
        _ => {
            let [a, b, c] = [a, b, c].map(|bits| float(bits, 16));
            let product = a * b;
            let near = product + c;
            if !near.is_finite() || near == 0.0 {
                return rounded(near, 16);
            }
            // Every product of two is a multiple of 2^-48 below 2^32, and so is what is added.
            let exact = (product * 2f64.powi(48)) as i128 + (c * 2f64.powi(48)) as i128;
            let mut magnitude = exact.unsigned_abs();
            let mut shift = 0;
            while magnitude >> 53 != 0 {
                // What is cut off stays seen in the last bit, below all that f16 rounds by.
                magnitude = magnitude >> 1 | magnitude & 1;
                shift += 1;
            }
            let value = magnitude as f64 * 2f64.powi(shift - 48);
            rounded(if exact < 0 { -value } else { value }, 16)
        }
    }
}

/// An instruction on two integers of one width; shifts take their amount as it is.
pub fn integers(op: Op, a: u64, b: u64, width: u32) -> Option<u64> {
    let (x, y) = (i128::from(a), i128::from(b));
    let (s, t) = (signed(a, width), signed(b, width));
    let shift = b < u64::from(width);
    let lowest = -(1i128 << (width - 1));
    let divides = t != 0 && !(s == lowest && t == -1);
    let result = match op {
        Op::IAdd => x + y,
        Op::ISub => x - y,
        Op::IMul => x.wrapping_mul(y),
        Op::BitwiseAnd => x & y,
        Op::BitwiseOr => x | y,
        Op::BitwiseXor => x ^ y,
        Op::ShiftLeftLogical if shift => x << b,
        Op::ShiftRightLogical if shift => x >> b,
        Op::ShiftRightArithmetic if shift => s >> b,
        Op::UDiv if y != 0 => x / y,
        Op::UMod if y != 0 => x % y,
        Op::SDiv if divides => s / t,
        Op::SRem if divides => s % t,
        // The sign of the divisor.
        Op::SMod if divides => {
            let rest = s % t;
            if rest != 0 && (rest < 0) != (t < 0) { rest + t } else { rest }
        }
        _ => return None,
    };
    Some(result as u64 & mask(width))
}

/// A comparison of two integers.
pub fn compares(op: Op, a: u64, b: u64, width: u32) -> Option<bool> {
    let (s, t) = (signed(a, width), signed(b, width));
    Some(match op {
        Op::IEqual => a == b,
        Op::INotEqual => a != b,
        Op::ULessThan => a < b,
        Op::ULessThanEqual => a <= b,
        Op::UGreaterThan => a > b,
        Op::UGreaterThanEqual => a >= b,
        Op::SLessThan => s < t,
        Op::SLessThanEqual => s <= t,
        Op::SGreaterThan => s > t,
        Op::SGreaterThanEqual => s >= t,
        _ => return None,
    })
}

/// A comparison of two floats.
pub fn compares_floats(op: Op, a: f64, b: f64) -> Option<bool> {
    let unordered = a.is_nan() || b.is_nan();
    Some(match op {
        Op::FOrdEqual => a == b,
        Op::FUnordEqual => unordered || a == b,
        Op::FOrdNotEqual => !unordered && a != b,
        Op::FUnordNotEqual => unordered || a != b,
        Op::FOrdLessThan => a < b,
        Op::FUnordLessThan => unordered || a < b,
        Op::FOrdGreaterThan => a > b,
        Op::FUnordGreaterThan => unordered || a > b,
        Op::FOrdLessThanEqual => a <= b,
        Op::FUnordLessThanEqual => unordered || a <= b,
        Op::FOrdGreaterThanEqual => a >= b,
        Op::FUnordGreaterThanEqual => unordered || a >= b,
        _ => return None,
    })
}

/// Addition, subtraction, multiplication or division of two floats.
pub fn floats(op: Op, a: u64, b: u64, width: u32) -> Option<u64> {
    if width == 32 {
        // In f32 itself: through f64 it would be rounded twice, though to the same.
        let (a, b) = (f32::from_bits(a as u32), f32::from_bits(b as u32));
        let result = match op {
            Op::FAdd => a + b,
            Op::FSub => a - b,
            Op::FMul => a * b,
            Op::FDiv => a / b,
            _ => return None,
        };
        return Some(result.to_bits().into());
    }
    let (a, b) = (float(a, width), float(b, width));
    // 53 >= 2 * 11 + 2 bits: rounding to f64 first changes nothing for f16.
    let result = match op {
        Op::FAdd => a + b,
        Op::FSub => a - b,
        Op::FMul => a * b,
        Op::FDiv => a / b,
        _ => return None,
    };
    Some(rounded(result, width))
}

/// An integer as a float.
pub fn integer_to_float(value: i128, width: u32) -> u64 {
    match width {
        16 if value.unsigned_abs() > 1 << 40 => rounded(if value < 0 { -1e30 } else { 1e30 }, 16),
        16 => rounded(value as f64, 16),
        32 => (value as f32).to_bits().into(),
        _ => (value as f64).to_bits(),
    }
}

/// A float cut off to an integer, where that can hold it.
pub fn float_to_integer(value: f64, width: u32, is_signed: bool) -> Option<u64> {
    let cut = value.trunc();
    let (least, most) = match is_signed {
        true => (-(2f64.powi(width as i32 - 1)), 2f64.powi(width as i32 - 1)),
        false => (0.0, 2f64.powi(width as i32)),
    };
    (cut >= least && cut < most).then(|| cut as i128 as u64 & mask(width))
}

/// An instruction of `GLSL.std.450` on integers.
pub fn extended_integers(op: GLOp, v: &[u64], width: u32) -> Option<u64> {
    let s = |at: usize| signed(v[at], width);
    let highest = |bits: u64| (0..width).rev().find(|at| bits >> at & 1 == 1).map_or(u64::MAX, u64::from);
    let result = match op {
        GLOp::SAbs => s(0).unsigned_abs() as u64,
        GLOp::SSign => s(0).signum() as u64,
        GLOp::UMin => v[0].min(v[1]),
        GLOp::UMax => v[0].max(v[1]),
        GLOp::SMin => s(0).min(s(1)) as u64,
        GLOp::SMax => s(0).max(s(1)) as u64,
        GLOp::UClamp if v[1] <= v[2] => v[0].max(v[1]).min(v[2]),
        GLOp::SClamp if s(1) <= s(2) => s(0).max(s(1)).min(s(2)) as u64,
        GLOp::FindILsb => (0..width).find(|at| v[0] >> at & 1 == 1).map_or(u64::MAX, u64::from),
        GLOp::FindUMsb => highest(v[0]),
        GLOp::FindSMsb => highest(if s(0) < 0 { !v[0] & mask(width) } else { v[0] }),
        _ => return None,
    };
    Some(result & mask(width))
}

/// An instruction of `GLSL.std.450` on floats.
pub fn extended_floats(op: GLOp, v: &[u64], width: u32) -> Option<u64> {
    let f = |at: usize| float(v[at], width);
    let least = |a: f64, b: f64| if b.is_nan() || a < b { a } else { b };
    let most = |a: f64, b: f64| if b.is_nan() || a > b { a } else { b };
    let n_min = |a: f64, b: f64| if a.is_nan() { b } else { least(a, b) };
    let n_max = |a: f64, b: f64| if a.is_nan() { b } else { most(a, b) };
    let result = match op {
        GLOp::RoundEven => f(0).round_ties_even(),
        GLOp::Trunc => f(0).trunc(),
        GLOp::Floor => f(0).floor(),
        GLOp::Ceil => f(0).ceil(),
        GLOp::FAbs => f(0).abs(),
        GLOp::Sqrt if width == 32 => return Some(f32::from_bits(v[0] as u32).sqrt().to_bits().into()),
        GLOp::Sqrt => f(0).sqrt(),
        GLOp::NMin => n_min(f(0), f(1)),
        GLOp::NMax => n_max(f(0), f(1)),
        GLOp::NClamp if f(1) <= f(2) => n_min(n_max(f(0), f(1)), f(2)),
        // The product is rounded by itself.
        GLOp::Fma => return floats(Op::FAdd, floats(Op::FMul, v[0], v[1], width)?, v[2], width),
        _ => return None,
    };
    Some(rounded(result, width))
}

#[test]
fn halves_round_to_even() {
    // 2049 lies between 2048 and 2050, 2051 between 2050 and 2052; 2^-25 is half the least one.
    assert_eq!([2049.0, 2051.0].map(|value| float(rounded(value, 16), 16)), [2048.0, 2052.0]);
    assert_eq!(
        [2f64.powi(-25), 1.5 * 2f64.powi(-25), 65_519.9, 65_520.0].map(|value| rounded(value, 16)),
        [0, 1, 0x7BFF, 0x7C00]
    );
    // (1 + 2^-6)^2 - 1 = 2^-5 (1 + 2^-7).
    assert_eq!(fused(0x3C10, 0x3C10, 0xBC00, 16), 0x2808);
    // 2048 * 2048 + 2^-24 is far from any tie; 2^-14 * 2^-11 + 2^-24 = 1.5 * 2^-24 is one, and goes
    // to 2.
    assert_eq!(fused(0x0400, 0x1000, 0x0001, 16), 2);
}
