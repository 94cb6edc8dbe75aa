//! Results of single operations on floats of 16 and 32 bits, drawn within what Vulkan bounds: how
//! quotients are rounded, how exact functions are, the sign of zeros, denormal numbers.
//!
//! Whether an instruction deviates is drawn once. How far it does is a function of its operands:
//! like on a device, the same operands give the same result.

use crate::many_seeds::executed_kernel::ExecutedKernel;
use crate::many_seeds::float_arithmetic::{FloatArithmetic, is_denormal, one, sign_bit};
use crate::many_seeds::lane_bits::{set_words, words};
use crate::stability::device_result;
use anyhit_engine::machine::{Batch, ChoiceKind, OpenChoices};
use anyhit_engine::math::array;
use anyhit_engine::math::random::Random;
use anyhit_engine::ops::lane_kernel::LaneKernel;
use anyhit_sanitize::lane_operands::LaneOperands;

/// The kernels whose precision Vulkan's table bounds by more than one rounding, without division.
const FUNCTIONS: [&str; 25] = [
    "Exp",
    "Exp2",
    "Log",
    "Log2",
    "Pow",
    "InverseSqrt",
    "Sqrt",
    "Sin",
    "Cos",
    "Tan",
    "Asin",
    "Acos",
    "Atan",
    "Atan2",
    "Sinh",
    "Cosh",
    "Tanh",
    "Asinh",
    "Acosh",
    "Atanh",
    "FMix",
    "FRem",
    "FMod",
    "Round",
    "SmoothStep",
];

/// The kernels whose zeros have a sign by a rule of arithmetic.
const SIGNED_ZEROS: [&str; 14] = [
    "FAdd",
    "FSub",
    "FMul",
    "FDiv",
    "FRem",
    "FMod",
    "FNegate",
    "FmaKHR",
    "Fma",
    "FMix",
    "Trunc",
    "Ceil",
    "Floor",
    "RoundEven",
];

/// Draws the results of an operation.
pub(super) fn after<const W: usize>(
    executed: ExecutedKernel<'_>,
    choices: &OpenChoices,
    arithmetic: &mut FloatArithmetic,
    batch: &mut Batch<W>,
) {
    let ExecutedKernel { kernel, licence, .. } = executed;
    let is_narrow = |width: u32| matches!(width, 16 | 32);
    if is_narrow(kernel.float_result) {
        if kernel.name == "FDiv" {
            executed.redraw(ChoiceKind::Division, choices, batch, |random, lane| {
                quotient(random, lane, arithmetic)
            });
        } else if FUNCTIONS.contains(&kernel.name) {
            executed.redraw(ChoiceKind::FunctionPrecision, choices, batch, function_value);
        }
        if licence.ignores_zero_sign && SIGNED_ZEROS.contains(&kernel.name) {
            executed.redraw(ChoiceKind::ZeroSign, choices, batch, zero);
        }
    }
    if licence.flushes && (is_narrow(kernel.float_result) || is_narrow(kernel.float_operands[0])) {
        executed.redraw(ChoiceKind::DenormalFlush, choices, batch, |random, lane| {
            flushed(random, lane, arithmetic)
        });
    }
}

/// An operation in one lane: its kernel, operands and result.
#[derive(Clone, Copy, Debug)]
struct LaneOperation {
    kernel: &'static LaneKernel,
    operands: LaneOperands,
    result: u64,
}

impl ExecutedKernel<'_> {
    /// Replaces the results in the running lanes by those of a function of the random numbers of
    /// the instruction; `None` leaves a result as it is.
    fn redraw<const W: usize>(
        &self,
        kind: ChoiceKind,
        choices: &OpenChoices,
        batch: &mut Batch<W>,
        mut result: impl FnMut(Random, LaneOperation) -> Option<u64>,
    ) {
        let Self { kernel, to, from, .. } = *self;
        let site = choices.site(kind, [0; 3], self.place(choices));
        let Some(random) = choices.draw(site) else { return };
        let mut differs = false;
        for lane in batch.mask.lanes() {
            let operands = LaneOperands::read(&batch.registers, kernel, from, 0, lane);
            let own = words(batch, to, kernel.words, lane);
            let Some(drawn) = result(random.clone(), LaneOperation { kernel, operands, result: own }) else {
                continue;
            };
            differs |= drawn != own;
            set_words(batch, to, kernel.words, lane, drawn);
        }
        if differs {
            self.note(choices, kind);
        }
    }
}

impl LaneOperation {
    /// The result as a device may give it, by the table of precisions. Infinities and NaNs stay.
    fn within_precision(&self, mut random: Random) -> Option<u64> {
        let Self { kernel, operands, result } = self;
        let width = kernel.float_result;
        let is_finite = match width {
            16 => half::f16::from_bits(*result as u16).is_finite(),
            _ => f32::from_bits(*result as u32).is_finite(),
        };
        let floats = (0..3).map(|at| if kernel.operands[at] > 0 { operands.float(at) } else { 0.0 });
        let floats: Vec<f64> = floats.collect();
        let bits = (0..3).map(|at| operands.unsigned(at));
        let seed = Random::of(random.bits(), bits).bits();
        let value = device_result(kernel.name, [floats[0], floats[1], floats[2]], width, seed);
        let value = value.filter(|value| is_finite && !value.is_nan())?;
        Some(match width {
            16 => half::f16::from_f64(value).to_bits().into(),
            _ => (value as f32).to_bits().into(),
        })
    }
}

/// A quotient: the dividend times the reciprocal of the divisor, or within 2.5 units in the last
/// place.
fn quotient(mut random: Random, operation: LaneOperation, arithmetic: &mut FloatArithmetic) -> Option<u64> {
    let (width, operands) = (operation.kernel.float_result, operation.operands);
    if operands.float(1) == 0.0 || !operands.float(1).is_finite() {
        return None;
    }
    match random.below(3) {
        0 => None,
        1 => {
            let reciprocal = arithmetic.div(width, one(width), operands.unsigned(1));
            Some(arithmetic.mul(width, operands.unsigned(0), reciprocal))
        }
        _ => operation.within_precision(random),
    }
}

/// The value of a function: exact, or within its precision.
fn function_value(mut random: Random, operation: LaneOperation) -> Option<u64> {
    (random.below(2) == 0).then(|| operation.within_precision(random))?
}

/// A zero with the sign that is drawn for its instruction.
fn zero(mut random: Random, operation: LaneOperation) -> Option<u64> {
    let sign = sign_bit(operation.kernel.float_result);
    let drawn = if random.below(2) == 0 { sign } else { 0 };
    (operation.result & !sign == 0).then_some(drawn)
}

/// The result with its denormal operands, or only itself, flushed to zeros of their sign.
fn flushed(mut random: Random, operation: LaneOperation, arithmetic: &mut FloatArithmetic) -> Option<u64> {
    let LaneOperation { kernel, operands, mut result } = operation;
    let flush = |width: u32, bits: u64| match is_denormal(width, bits) {
        true => bits & sign_bit(width),
        false => bits,
    };
    let which = random.below(3);
    if which == 0 {
        return None;
    }
    let own = array::from_fn(|at| operands.unsigned(at));
    let inputs = array::from_fn(|at| match kernel.float_operands[at] {
        width @ (16 | 32) => flush(width, own[at]),
        _ => own[at],
    });
    if which == 1 && inputs != own {
        result = arithmetic.run(kernel, inputs);
    }
    Some(match kernel.float_result {
        width @ (16 | 32) => flush(width, result),
        _ => result,
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use anyhit_engine::machine::Reg;
    use anyhit_engine::machine::Registers;
    use anyhit_engine::ops::arithmetic::{FDiv, FMul};
    use anyhit_engine::ops::glsl::Log2;
    use anyhit_engine::ops::lane_kernel::OpFamily;
    use anyhit_engine::ops::relational_logical::FOrdGreaterThan;

    /// An operation on two floats of 32 bits, with its own result.
    fn operation(family: &'static OpFamily, operands: [f32; 2]) -> LaneOperation {
        let kernel = family.kernel(32).expect("a kernel");
        let mut registers = Registers::<1>::new(4);
        let from = [Reg(0), Reg(2), Reg(2)];
        for (register, operand) in from.into_iter().zip(operands) {
            registers.set_lane_words(register, 0, [operand.to_bits()]);
        }
        let operands = LaneOperands::read(&registers, kernel, &from, 0, 0);
        let bits = [operands.unsigned(0), operands.unsigned(1), 0];
        LaneOperation { kernel, operands, result: FloatArithmetic::default().run(kernel, bits) }
    }

    fn drawn(mut draw: impl FnMut(Random) -> Option<u64>) -> BTreeSet<u64> {
        (0..400).filter_map(|seed| draw(Random::new(seed))).collect()
    }

    #[test]
    fn quotients_are_within_their_bounds() {
        let of = operation(&FDiv, [41.0, 41.0]);
        let arithmetic = &mut FloatArithmetic::default();
        let found = drawn(|random| quotient(random, of, arithmetic));
        // Below 1 a unit in the last place is half as large: 2.5 of those of 1 are up to 5 floats.
        let one = u64::from(1f32.to_bits());
        assert!(found.iter().all(|&bits| (one - 5..=one + 2).contains(&bits)), "{found:?}");
        assert!(found.contains(&(one - 1)) && found.contains(&(one + 1)), "{found:?}");
        let by_zero = operation(&FDiv, [1.0, 0.0]);
        assert!(drawn(|random| quotient(random, by_zero, arithmetic)).is_empty());
    }

    #[test]
    fn functions_are_within_their_precision_and_repeat_their_results() {
        // log2(8) = 3 to 3 units in the last place.
        let of = operation(&Log2, [8.0, 0.0]);
        let found = drawn(|random| function_value(random, of));
        let three = u64::from(3f32.to_bits());
        assert!(found.len() > 3 && found.iter().all(|&bits| (three - 3..=three + 3).contains(&bits)));
        let once = |seed| function_value(Random::new(seed), of);
        assert!((0..20).all(|seed| once(seed) == once(seed)));
    }

    #[test]
    fn zeros_have_either_sign_and_other_numbers_keep_theirs() {
        let both: BTreeSet<u64> = [0f32, -0.0].map(|zero| u64::from(zero.to_bits())).into();
        assert_eq!(drawn(|random| zero(random, operation(&FMul, [0.0, 3.0]))), both);
        assert!(drawn(|random| zero(random, operation(&FMul, [-1.0, 3.0]))).is_empty());
    }

    #[test]
    fn denormal_operands_and_results_are_flushed() {
        let arithmetic = &mut FloatArithmetic::default();
        let product = operation(&FMul, [-1e-20, 1e-20]);
        let found = drawn(|random| flushed(random, product, arithmetic));
        assert_eq!(found, [u64::from((-0f32).to_bits())].into());
        // 1e-40 is above 0 only where it is not flushed; it is where results alone are.
        let comparison = operation(&FOrdGreaterThan, [1e-40, 0.0]);
        assert_eq!(drawn(|random| flushed(random, comparison, arithmetic)), [0, 1].into());
    }
}
