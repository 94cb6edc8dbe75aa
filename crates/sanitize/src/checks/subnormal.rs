//! Subnormal numbers that decide something: an implementation may flush them to 0.

use crate::flushed_use::FlushedUse;
use crate::lane_operands::LaneOperands;
use crate::plan::Executed;
use crate::rule::arithmetic;
use crate::sanitizer::Sanitizer;
use crate::word_range::WordRange;
use anyhit_engine::machine::{Batch, Mask, NO_CAUSE, Reg, Registers, ShadowRegisters};
use anyhit_engine::ops::lane_kernel::LaneKernel;

/// Reports a divisor, or a comparison, that is another one where subnormal numbers are flushed.
pub(super) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &ShadowRegisters<W>,
    executed: Executed<'_>,
    kernel: &LaneKernel,
    from: &[Reg; 3],
    flushed: FlushedUse,
) {
    let registers = &batch.registers;
    let lanes = |at: usize| subnormal_lanes(registers, from[at], kernel.float_operands[at]);
    let subnormal = if flushed == FlushedUse::Divisor { lanes(1) } else { lanes(0) | lanes(1) };
    let subnormal = subnormal & batch.mask;
    if subnormal.is_empty() {
        return;
    }
    let suspects = subnormal.without(shadow.undefined(from[0]) | shadow.undefined(from[1]));
    let read = |lane| LaneOperands::read(registers, kernel, from, 0, lane);
    let decides = Mask::from_fn(|lane| suspects.contains(lane) && read(lane).flushing_matters(flushed));
    let Some(lane) = decides.lowest() else { return };
    let operation = read(lane).describe_operation(kernel);
    let message = format!("{operation}: a subnormal number, which may be flushed to 0, {}", flushed.does());
    let rule = &arithmetic::SUBNORMAL;
    sanitizer.reporter(batch).broken_by(rule, executed.place.op, decides, message, NO_CAUSE);
}

/// The lanes in which a float is subnormal.
fn subnormal_lanes<const W: usize>(registers: &Registers<W>, first: Reg, width: u32) -> Mask<W> {
    let low = &registers[first];
    let high = &registers[if width == 64 { first.plus(1) } else { first }];
    let (exponent, mantissa) = match width {
        16 => (0x7C00, 0x03FF),
        32 => (0x7F80_0000, 0x007F_FFFF),
        _ => (0x7FF0_0000, 0x000F_FFFF),
    };
    let rest = |lane: usize| high.0[lane] & mantissa | if width == 64 { low.0[lane] } else { 0 };
    // Most often there is none, which a loop without branches finds out.
    let any = match width {
        32 => WordRange::SUBNORMAL.meets(low),
        _ => high.0.iter().fold(false, |any, word| any | (word & exponent == 0)),
    };
    if !any { Mask::NONE } else { Mask::from_fn(|lane| high.0[lane] & exponent == 0 && rest(lane) != 0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subnormal_numbers_of_each_width() {
        let mut registers = Registers::<4>::new(2);
        for (lane, value) in [0.0, 1e-40f32, f32::MIN_POSITIVE, -1e-45].into_iter().enumerate() {
            registers.set_lane_words(Reg(0), lane, [value.to_bits()]);
        }
        let expected = Mask::lane(1) | Mask::lane(3);
        assert_eq!(subnormal_lanes(&registers, Reg(0), 32), expected);
        for (lane, value) in [0.0, 5e-324f64, f64::MIN_POSITIVE, -1e-310].into_iter().enumerate() {
            let bits = value.to_bits();
            registers.set_lane_words(Reg(0), lane, [bits as u32, (bits >> 32) as u32]);
        }
        assert_eq!(subnormal_lanes(&registers, Reg(0), 64), expected);
        for (lane, bits) in [0x0000, 0x0001, 0x0400, 0x83FF].into_iter().enumerate() {
            registers.set_lane_words(Reg(0), lane, [bits]);
        }
        assert_eq!(subnormal_lanes(&registers, Reg(0), 16), expected);
    }
}
