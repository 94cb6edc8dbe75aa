//! Lane kernels under the sanitizer: how what is undefined spreads through them, which operands
//! break a rule, and where NaNs are made.

use crate::machine::{Batch, Mask, Reg, Registers, ShadowRegisters};
use crate::ops::lane_kernel::LaneKernel;
use crate::sanitize::cause::{Cause, CauseDetails, OpPlace};
use crate::sanitize::checks::fast_math;
use crate::sanitize::checks::lanes::{nan_lanes, operand_words};
use crate::sanitize::operand_check::LaneOperands;
use crate::sanitize::plan::{Executed, Flow};
use crate::sanitize::rule::{RuleKind, arithmetic};
use crate::sanitize::sanitizer::Sanitizer;

/// A lane kernel has run.
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
    let undefined = undefined_result(registers, shadow, step.flow, kernel, from);
    for word in 0..kernel.words {
        shadow.set_undefined(to.plus(word), undefined);
    }
    if !undefined.is_empty() {
        for (operand, word) in operand_words(kernel, from) {
            let register = operand.plus(word);
            let lanes = shadow.undefined(register) & undefined;
            (0..kernel.words).for_each(|word| shadow.copy_causes(to.plus(word), register, lanes));
        }
    }
    for check in &step.checks {
        let suspects = batch.mask.without(undefined);
        let broken = Mask::from_fn(|lane| {
            suspects.contains(lane)
                && (check.breaks)(&LaneOperands::read(registers, kernel, from, step.result_width, lane))
        });
        let Some(lane) = broken.lowest() else { continue };
        let operands = || LaneOperands::read(registers, kernel, from, step.result_width, lane);
        match check.rule.kind {
            RuleKind::UndefinedValue => {
                let cause = Cause::Broken { place, rule: check.rule.id };
                let details =
                    || Some(CauseDetails { rule: check.rule, message: (check.message)(&operands()) });
                let number = sanitizer.cause(cause, details);
                shadow.undefine_span(to, kernel.words, broken, number);
            }
            _ => {
                sanitizer.reporter(batch).broken(check.rule, place.op, broken, (check.message)(&operands()));
            }
        }
    }
    if !step.fast_math.is_none() {
        fast_math::check(sanitizer, batch, shadow, executed, kernel, to, from);
    }
    if kernel.float_result > 0 {
        note_nan(sanitizer, batch, shadow, place, kernel, to, from);
    }
    if step.watches_nan {
        compare(sanitizer, batch, shadow, place, kernel, from);
    }
}

/// Keeps where the NaNs of a result were made.
fn note_nan<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    kernel: &LaneKernel,
    to: Reg,
    from: &[Reg; 3],
) {
    let registers = &batch.registers;
    let nans = (nan_lanes(registers, to, kernel.float_result) & batch.mask).without(shadow.undefined(to));
    if nans.is_empty() {
        return;
    }
    let mut born = nans;
    for (&operand, &width) in from.iter().zip(&kernel.float_operands).filter(|(_, width)| **width > 0) {
        let inherited = nan_lanes(registers, operand, width) & born;
        shadow.copy_causes(to, operand, inherited);
        born = born.without(inherited);
    }
    if !born.is_empty() {
        let number = sanitizer.cause(Cause::Nan(place), || None);
        shadow.set_cause(to, born, number);
    }
}

/// Reports a comparison with a NaN that an instruction has made.
fn compare<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &ShadowRegisters<W>,
    place: OpPlace,
    kernel: &LaneKernel,
    from: &[Reg; 3],
) {
    for (&operand, &width) in from.iter().zip(&kernel.float_operands).filter(|(_, width)| **width > 0) {
        let nans = nan_lanes(&batch.registers, operand, width) & batch.mask;
        let nans = nans.without(shadow.undefined(operand));
        sanitizer.reporter(batch).nan(&arithmetic::NAN_BRANCH, shadow, place.op, operand, nans);
    }
}

/// The lanes in which the result of a kernel is undefined because an operand is.
#[inline]
fn undefined_result<const W: usize>(
    registers: &Registers<W>,
    shadow: &ShadowRegisters<W>,
    flow: Flow,
    kernel: &LaneKernel,
    from: &[Reg; 3],
) -> Mask<W> {
    let of = |at: usize| {
        (0..kernel.operands[at]).fold(Mask::NONE, |all, word| all | shadow.undefined(from[at].plus(word)))
    };
    let each = [of(0), of(1), of(2)];
    let any = each[0] | each[1] | each[2];
    if any.is_empty() {
        return any;
    }
    let decided = |by: u32| {
        let lanes = |at: usize| {
            let all = |word: u32| Mask::equal(&registers[from[at].plus(word)], by);
            (0..kernel.operands[at]).fold(Mask::ALL, |lanes, word| lanes & all(word)).without(each[at])
        };
        lanes(0) | lanes(1)
    };
    match flow {
        Flow::Any => any,
        Flow::And => any.without(decided(0)),
        Flow::Or { ones } => any.without(decided(ones)),
        Flow::Select => {
            let first = registers.mask(from[0]);
            each[0] | (each[1] & first) | each[2].without(first)
        }
    }
}
