//! Lane kernels under the sanitizer: how what is undefined spreads through them, which operands
//! break a rule, and where NaNs are made.

use crate::machine::{Batch, Mask, Reg, Registers, ShadowRegisters};
use crate::ops::lane_kernel::LaneKernel;
use crate::sanitize::cause::{Cause, CauseDetails, OpPlace};
use crate::sanitize::decorated;
use crate::sanitize::operand_check::LaneOperands;
use crate::sanitize::plan::{Executed, Flow};
use crate::sanitize::rule::{RuleKind, arithmetic};
use crate::sanitize::sanitizer::Sanitizer;

impl Sanitizer<'_> {
    pub(super) fn kernel<const W: usize>(
        &mut self,
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
                    let number = self.causes.number(cause, details);
                    shadow.undefine_span(to, kernel.words, broken, number);
                }
                RuleKind::UndefinedBehavior | RuleKind::OpenChoice | RuleKind::Lint => {
                    self.reporter(batch).broken(check.rule, place.op, broken, (check.message)(&operands()));
                }
            }
        }
        if !step.fast_math.is_none() {
            decorated::check_fast_math(self, batch, shadow, executed, kernel, to, from);
        }
        if kernel.float_result > 0 {
            self.note_nan(batch, shadow, place, kernel, to, from);
        }
        if step.watches_nan {
            self.compare(batch, shadow, place, kernel, from);
        }
    }

    /// Keeps where the NaNs of a result were made.
    pub(super) fn note_nan<const W: usize>(
        &mut self,
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
            let number = self.causes.number(Cause::Nan(place), || None);
            shadow.set_cause(to, born, number);
        }
    }

    /// Reports a comparison with a NaN that an instruction has made.
    pub(super) fn compare<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &ShadowRegisters<W>,
        place: OpPlace,
        kernel: &LaneKernel,
        from: &[Reg; 3],
    ) {
        for (&operand, &width) in from.iter().zip(&kernel.float_operands).filter(|(_, width)| **width > 0) {
            let nans = nan_lanes(&batch.registers, operand, width) & batch.mask;
            let nans = nans.without(shadow.undefined(operand));
            self.reporter(batch).nan(&arithmetic::NAN_BRANCH, shadow, place.op, operand, nans);
        }
    }
}

/// The registers that the words of a kernel's operands have.
pub(in crate::sanitize) fn operand_words<'a>(
    kernel: &'a LaneKernel,
    from: &'a [Reg; 3],
) -> impl Iterator<Item = (Reg, u32)> + 'a {
    from.iter().zip(kernel.operands).flat_map(|(&operand, words)| (0..words).map(move |word| (operand, word)))
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

/// The lanes in which a float is a NaN.
#[inline]
pub(in crate::sanitize) fn nan_lanes<const W: usize>(
    registers: &Registers<W>,
    first: Reg,
    width: u32,
) -> Mask<W> {
    let (low, high) =
        (&registers[first], if width == 64 { &registers[first.plus(1)] } else { &registers[first] });
    let is_nan = |lane: usize| match width {
        16 => low.0[lane] & 0x7FFF > 0x7C00,
        32 => low.0[lane] & 0x7FFF_FFFF > 0x7F80_0000,
        _ => (u64::from(high.0[lane] & 0x7FFF_FFFF) << 32 | u64::from(low.0[lane])) > 0x7FF0_0000_0000_0000,
    };
    // Most often there is none, which a loop without branches finds out.
    let any = match width {
        32 => low.0.iter().fold(0, |any, word| any | u32::from(word & 0x7FFF_FFFF > 0x7F80_0000)) != 0,
        _ => true,
    };
    if any { Mask::from_fn(is_nan) } else { Mask::NONE }
}
