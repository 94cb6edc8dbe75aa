//! The operands of a lane kernel in one lane, and what rules ask of them.

use crate::flushed_use::FlushedUse;
use anyhit_engine::machine::{Lanes, Reg, Registers};
use anyhit_engine::math::array;
use anyhit_engine::ops::arithmetic::{FAdd, FDiv, FMul, FSub};
use anyhit_engine::ops::float_controls::rounded_family;
use anyhit_engine::ops::lane_kernel::{LaneKernel, OpFamily};
use anyhit_engine::ops::relational_logical as logical;

/// The signs between two operands.
static SIGNS: [(&[&OpFamily], &str); 10] = [
    (&[&FAdd], "+"),
    (&[&FSub], "-"),
    (&[&FMul], "*"),
    (&[&FDiv], "/"),
    (&[&logical::FOrdEqual, &logical::FUnordEqual], "=="),
    (&[&logical::FOrdNotEqual, &logical::FUnordNotEqual], "!="),
    (&[&logical::FOrdLessThan, &logical::FUnordLessThan], "<"),
    (&[&logical::FOrdGreaterThan, &logical::FUnordGreaterThan], ">"),
    (&[&logical::FOrdLessThanEqual, &logical::FUnordLessThanEqual], "<="),
    (&[&logical::FOrdGreaterThanEqual, &logical::FUnordGreaterThanEqual], ">="),
];

/// The operands of a lane kernel in one lane, as bits.
#[derive(Clone, Copy, Debug)]
pub struct LaneOperands {
    bits: [u64; 3],
    floats: [u32; 3],
    /// Bits of the operand that selects the kernel.
    pub(super) width: u32,
    /// Bits of the result where it is a float; else 0.
    pub(super) float_result: u32,
    /// Bits of a scalar of the instruction's result.
    pub(super) result_width: u32,
}

impl LaneOperands {
    /// The operands of a kernel in a lane of a batch, and the bits of a scalar of its result.
    pub fn read<const W: usize>(
        registers: &Registers<W>,
        kernel: &LaneKernel,
        from: &[Reg; 3],
        result_width: u32,
        lane: usize,
    ) -> Self {
        let word = |register: Reg| -> u64 {
            let Lanes(words) = &registers[register];
            words[lane].into()
        };
        let bits = array::from_fn(|at| match kernel.operands[at] {
            0 => 0,
            1 => word(from[at]),
            _ => word(from[at]) | word(from[at].plus(1)) << 32,
        });
        let LaneKernel { float_operands: floats, width, float_result, .. } = *kernel;
        Self { bits, floats, width, float_result, result_width }
    }

    /// An operand that is a float.
    pub fn float(&self, at: usize) -> f64 {
        match self.floats[at] {
            16 => half::f16::from_bits(self.bits[at] as u16).to_f64(),
            32 => f32::from_bits(self.bits[at] as u32).into(),
            _ => f64::from_bits(self.bits[at]),
        }
    }

    /// An operand that is an unsigned integer.
    pub fn unsigned(&self, at: usize) -> u64 {
        self.bits[at]
    }

    /// An operand that is a signed integer of the kernel's width.
    pub fn signed(&self, at: usize) -> i64 {
        let unused = 64 - self.width.clamp(1, 64);
        (self.bits[at] << unused) as i64 >> unused
    }

    /// Whether the whole part of the first operand fits in a result that is an integer.
    pub(super) fn fits(&self, signed: bool) -> bool {
        let (whole, bits) = (self.float(0).trunc(), self.result_width as i32);
        match signed {
            true => whole >= -2f64.powi(bits - 1) && whole < 2f64.powi(bits - 1),
            false => whole >= 0.0 && whole < 2f64.powi(bits),
        }
    }

    /// Whether the exact result of an operation on unsigned integers of the kernel's width does not
    /// fit in it.
    pub(super) fn overflows_unsigned(&self, operation: impl Fn(u128, u128) -> Option<u128>) -> bool {
        let result = operation(self.unsigned(0).into(), self.unsigned(1).into());
        result.is_none_or(|result| result >> self.width.clamp(1, 64) != 0)
    }

    /// Whether the exact result of an operation on signed integers of the kernel's width does not
    /// fit in it.
    pub(super) fn overflows_signed(&self, operation: impl Fn(i128, i128) -> i128) -> bool {
        let result = operation(self.signed(0).into(), self.signed(1).into());
        result < self.least().into() || result > (!self.least()).into()
    }

    /// Whether a shift to the left within the width changes the number that is shifted, other than
    /// by a power of two.
    pub(super) fn shifts_out(&self, signed: bool) -> bool {
        let amount = self.unsigned(1);
        amount < self.width.into()
            && match signed {
                true => self.overflows_signed(|value, _| value << amount),
                false => self.overflows_unsigned(|value, _| Some(value << amount)),
            }
    }

    /// Whether the first operand is finite, and infinite in a float of so many bits.
    pub(super) fn narrows_to_infinity(&self, bits: u32) -> bool {
        let value = self.float(0);
        let narrow = match bits {
            16 => half::f16::from_f64(value).to_f64(),
            32 => f64::from(value as f32),
            _ => value,
        };
        value.is_finite() && narrow.is_infinite()
    }

    /// Whether the first two operands do something else where subnormal numbers are flushed to 0.
    pub fn flushing_matters(&self, flushed: FlushedUse) -> bool {
        let [a, b] = [self.float(0), self.float(1)];
        let [low, high] = [a, b].map(|value| if value.abs() < self.least_normal() { 0.0 } else { value });
        match flushed {
            FlushedUse::Divisor => b != high,
            FlushedUse::Below => (a < b) != (low < high),
            FlushedUse::Above => (a > b) != (low > high),
            FlushedUse::Equal => (a == b) != (low == high),
        }
    }

    /// The least positive normal float of the kernel's width.
    pub(super) fn least_normal(&self) -> f64 {
        match self.width {
            16 => half::f16::MIN_POSITIVE.to_f64(),
            32 => f32::MIN_POSITIVE.into(),
            _ => f64::MIN_POSITIVE,
        }
    }

    /// The exponent of the greatest divisor for which the error of a division is bounded.
    pub(super) fn greatest_divisor(&self) -> i32 {
        match self.width {
            16 => 14,
            32 => 126,
            _ => f64::MAX_EXP,
        }
    }

    /// Whether the first operand is the square of a length of 1, give or take what an encoding of
    /// unit vectors in few bits loses.
    pub(super) fn is_square_of_unit(&self) -> bool {
        const TOLERANCE: f64 = 0.01;
        let error = (self.float(0).sqrt() - 1.0).abs();
        error <= TOLERANCE || error.is_nan()
    }

    /// Two operands of an operation as a report shows them, with its sign between them.
    pub(super) fn describe_sum(&self, sign: &str, signed: bool) -> String {
        format!("{} {sign} {} in {} bits", self.describe(0, signed), self.describe(1, signed), self.width)
    }

    /// The operation that a kernel does with the operands, as a report shows it.
    pub fn describe_operation(&self, kernel: &LaneKernel) -> String {
        let family = rounded_family(kernel);
        let known = SIGNS.iter().find(|(families, _)| families.contains(&family));
        let Some((_, sign)) = known else {
            let count = kernel.operands.iter().filter(|words| **words > 0).count();
            let operands: Vec<String> = (0..count).map(|at| self.describe(at, true)).collect();
            return format!("{}({})", family.name.to_lowercase(), operands.join(", "));
        };
        format!("{} {sign} {}", self.describe(0, true), self.describe(1, true))
    }

    /// The least signed integer of the kernel's width.
    pub(super) fn least(&self) -> i64 {
        i64::MIN >> (64 - self.width.clamp(1, 64))
    }

    /// An operand as a report shows it.
    pub fn describe(&self, at: usize, signed: bool) -> String {
        match self.floats[at] {
            16 => half::f16::from_bits(self.bits[at] as u16).to_string(),
            32 => format!("{:?}", f32::from_bits(self.bits[at] as u32)),
            64 => format!("{:?}", f64::from_bits(self.bits[at])),
            _ if signed => self.signed(at).to_string(),
            _ => self.unsigned(at).to_string(),
        }
    }
}
