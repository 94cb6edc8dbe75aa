//! Rules about operations whose decorations promise something of their operands and results.

use crate::machine::{Batch, Mask, Reg, Registers, ShadowRegisters};
use crate::ops::lane_kernel::LaneKernel;
use crate::sanitize::cause::{Cause, CauseDetails};
use crate::sanitize::checks::lanes::nan_lanes;
use crate::sanitize::plan::Executed;
use crate::sanitize::rule::arithmetic;
use crate::sanitize::sanitizer::Sanitizer;

/// Finds the lanes in which a float, given by its first register and its width, is of some kind.
type FloatLanes<const W: usize> = fn(&Registers<W>, Reg, u32) -> Mask<W>;

/// Makes the result of an operation undefined where an operand or the result is a NaN or infinite
/// although `FPFastMathMode` says that it is not.
pub(in crate::sanitize) fn check<const W: usize>(
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
                Some(CauseDetails { rule, message })
            });
            shadow.undefine_span(to, kernel.words, lanes, number);
        }
    }
}

/// The lanes in which a float is infinite.
fn infinite_lanes<const W: usize>(registers: &Registers<W>, first: Reg, width: u32) -> Mask<W> {
    let low = &registers[first];
    match width {
        16 => Mask::from_fn(|lane| low.0[lane] & 0x7FFF == 0x7C00),
        32 => Mask::from_fn(|lane| low.0[lane] & 0x7FFF_FFFF == 0x7F80_0000),
        _ => {
            let high = &registers[first.plus(1)];
            Mask::from_fn(|lane| high.0[lane] & 0x7FFF_FFFF == 0x7FF0_0000 && low.0[lane] == 0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinities_of_each_width() {
        let mut registers = Registers::<4>::new(2);
        let lanes = |registers: &Registers<4>, width| infinite_lanes(registers, Reg(0), width);
        for (lane, value) in [1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN].into_iter().enumerate() {
            registers.set_lane_words(Reg(0), lane, [value.to_bits()]);
        }
        assert_eq!(lanes(&registers, 32), Mask::lane(1) | Mask::lane(2));
        for (lane, value) in [1.0, f64::INFINITY, f64::NAN, f64::MAX].into_iter().enumerate() {
            let bits = value.to_bits();
            registers.set_lane_words(Reg(0), lane, [bits as u32, (bits >> 32) as u32]);
        }
        assert_eq!(lanes(&registers, 64), Mask::lane(1));
        for (lane, bits) in [0x3C00, 0x7C00, 0xFC00, 0x7C01].into_iter().enumerate() {
            registers.set_lane_words(Reg(0), lane, [bits]);
        }
        assert_eq!(lanes(&registers, 16), Mask::lane(1) | Mask::lane(2));
    }
}
