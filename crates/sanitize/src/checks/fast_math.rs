//! Rules about operations whose decorations promise something of their operands and results.

use crate::cause::{Cause, CauseDetails};
use crate::checks::lanes::{infinite_lanes, nan_lanes};
use crate::plan::Executed;
use crate::rule::arithmetic;
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Mask, NO_CAUSE, Reg, Registers, ShadowRegisters};
use anyhit_engine::ops::lane_kernel::LaneKernel;

/// Finds the lanes in which a float, given by its first register and its width, is of some kind.
type FloatLanes<const W: usize> = fn(&Registers<W>, Reg, u32) -> Mask<W>;

/// Makes the result of an operation undefined where an operand or the result is a NaN or infinite
/// although `FPFastMathMode` says that it is not.
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    kernel: &'static LaneKernel,
    to: Reg,
    from: &[Reg; 3],
) {
    let Executed { place, step } = executed;
    let registers = &batch.registers;
    let operands = from.iter().copied().zip(kernel.float_operands);
    let floats = operands.chain([(to, kernel.float_result)]).filter(|(_, width)| *width > 0);
    let suspects = batch.mask.without(shadow.undefined(to));
    for (register, width) in floats {
        let promises: [(bool, FloatLanes<W>, &str, &str); 2] = [
            (step.fast_math.not_nan, nan_lanes, "a NaN", "NotNaN"),
            (step.fast_math.not_infinite, infinite_lanes, "an infinity", "NotInf"),
        ];
        for (_, find, what, flag) in promises.into_iter().filter(|(promised, ..)| *promised) {
            let lanes = find(registers, register, width) & suspects;
            if lanes.is_empty() {
                continue;
            }
            let role = if register == to { "result" } else { "operand" };
            let rule = &arithmetic::FASTMATH_FLAGS;
            let number = sanitizer.cause(Cause::Broken { place, rule: rule.id }, || {
                let message = format!("{what} as {role} of an operation decorated {flag}");
                Some(CauseDetails { rule, message, operand: NO_CAUSE })
            });
            shadow.undefine_span(to, kernel.words, lanes, number);
        }
    }
}
