//! Lane kernels under the sanitizer: how what is undefined spreads through them, which operands
//! break a rule.

use crate::cause::{Cause, CauseDetails};
use crate::checks::lanes::{operand_words, special_lanes};
use crate::checks::{births, fast_math, subnormal};
use crate::lane_operands::LaneOperands;
use crate::operand_check::OperandCheck;
use crate::plan::{Executed, FloatCounter, Flow, OpPlan, Specials};
use crate::rule::{RuleKind, arithmetic};
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Mask, NO_CAUSE, Reg, Registers, ShadowRegisters};
use anyhit_engine::ops::lane_kernel::LaneKernel;

/// A lane kernel has run.
#[inline]
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    kernel: &'static LaneKernel,
    to: Reg,
    from: &[Reg; 3],
) {
    let step = executed.step;
    let clean = are_clean(shadow, kernel, from);
    (0..kernel.words).for_each(|word| shadow.define(to.plus(word)));
    if !clean {
        spread(sanitizer, batch, shadow, step, kernel, to, from);
    }
    if !step.is_plain {
        check_rules(sanitizer, batch, shadow, executed, kernel, to, from);
    }
    match step.specials {
        Specials::Born => births::note(sanitizer, batch, shadow, executed, kernel, to, from),
        Specials::Inherited | Specials::Carried if clean => {}
        Specials::Carried => births::carry(batch, shadow, kernel, to, from),
        Specials::Inherited if step.flow == Flow::Select => births::select(batch, shadow, to, from),
        Specials::Inherited => births::note(sanitizer, batch, shadow, executed, kernel, to, from),
        Specials::None => {}
    }
    if step.watches_special && !clean {
        births::compare(sanitizer, batch, shadow, executed.place, kernel, from);
    }
}

/// Whether nothing is known of any operand: most often so, and then of the result neither.
#[inline]
fn are_clean<const W: usize>(shadow: &ShadowRegisters<W>, kernel: &LaneKernel, from: &[Reg; 3]) -> bool {
    let is_clean = |at: usize| match kernel.operands[at] {
        0 => true,
        1 => shadow.is_clean(from[at]),
        words => (0..words).all(|word| shadow.is_clean(from[at].plus(word))),
    };
    is_clean(0) && is_clean(1) && is_clean(2)
}

/// What is undefined spreads to the result, which counted as defined.
#[inline(never)]
fn spread<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    step: &OpPlan,
    kernel: &LaneKernel,
    to: Reg,
    from: &[Reg; 3],
) {
    let undefined = undefined_result(&batch.registers, shadow, step.flow, kernel, from);
    for word in 0..kernel.words {
        shadow.set_undefined(to.plus(word), undefined);
    }
    if step.flow == Flow::Merge {
        merge_fields(sanitizer, batch, shadow, kernel, to, from);
    } else if !undefined.is_empty() {
        for (operand, word) in operand_words(kernel, from) {
            let register = operand.plus(word);
            let lanes = shadow.undefined(register) & undefined;
            (0..kernel.words).for_each(|word| shadow.copy_causes(to.plus(word), register, lanes));
        }
    }
}

/// Looks for the rules that a kernel breaks.
#[inline(never)]
fn check_rules<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    kernel: &'static LaneKernel,
    to: Reg,
    from: &[Reg; 3],
) {
    let Executed { place, step } = executed;
    for open in step.checks.iter().filter(|open| open.may_break(&batch.registers)) {
        check_operands(sanitizer, batch, shadow, executed, kernel, (to, from), open.check);
    }
    if !step.fast_math.is_none() {
        fast_math::check(sanitizer, batch, shadow, executed, kernel, to, from);
    }
    if let Some(counter) = step.counter {
        check_counter(sanitizer, batch, executed, kernel, to, from, counter);
    }
    if step.expects {
        sanitizer.expectations.count(batch, place, to);
    }
    if let Some(flushed) = step.flushed {
        subnormal::check(sanitizer, batch, shadow, executed, kernel, from, flushed);
    }
}

/// Looks for lanes in which the operands of a kernel break a rule.
fn check_operands<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    kernel: &LaneKernel,
    (to, from): (Reg, &[Reg; 3]),
    check: &'static OperandCheck,
) {
    let Executed { place, step } = executed;
    let registers = &batch.registers;
    let operands = |lane: usize| LaneOperands::read(registers, kernel, from, step.result_width, lane);
    let suspects = batch.mask.without(shadow.undefined(to));
    let broken = Mask::from_fn(|lane| suspects.contains(lane) && (check.breaks)(&operands(lane)));
    let Some(lane) = broken.lowest() else { return };
    let operand = special_operand(registers, shadow, kernel, from, lane);
    if let Some(constant) = step.constant {
        let Some((_, plan)) = sanitizer.plan() else { return };
        let name = plan.program.module.name(constant).filter(|name| !name.is_empty());
        let constant = name.map_or("a specialization constant".to_owned(), |name| {
            format!("the specialization constant `{name}`")
        });
        let message = format!("{}, in {constant}", (check.message)(&operands(lane)));
        sanitizer.reporter(batch).broken_by(check.rule, place.op, broken, message, operand);
        return;
    }
    match check.rule.kind {
        RuleKind::UndefinedValue => {
            let cause = Cause::Broken { place, rule: check.rule.id };
            let message = || (check.message)(&operands(lane));
            let details = || Some(CauseDetails { rule: check.rule, message: message(), operand });
            let number = sanitizer.cause(cause, details);
            shadow.undefine_span(to, kernel.words, broken, number);
        }
        _ => {
            let message = (check.message)(&operands(lane));
            sanitizer.reporter(batch).broken_by(check.rule, place.op, broken, message, operand);
        }
    }
}

/// Copies the causes of a field and of what it is inserted into. Of the latter, the bits that a
/// field was written to are defined, and so is a word of which all bits are.
fn merge_fields<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    kernel: &LaneKernel,
    to: Reg,
    from: &[Reg; 3],
) {
    let all = if kernel.width < u32::BITS { (1 << kernel.width) - 1 } else { u32::MAX };
    for word in 0..kernel.words {
        let [mask, field, base, to] = [from[0], from[1], from[2], to].map(|first| first.plus(word));
        let inserted = shadow.undefined(to);
        for operand in [mask, field] {
            shadow.copy_causes(to, operand, shadow.undefined(operand) & inserted);
        }
        for lane in (shadow.undefined(base) & batch.mask).without(inserted).lanes() {
            let bits = batch.registers[mask].0[lane];
            if let Some(number) = sanitizer.filled_cause(shadow.cause(base, lane), bits, all) {
                shadow.undefine(to, Mask::lane(lane), number);
            }
        }
    }
}

/// Reports a float that counts the turns of a loop, and that its step does not change.
fn check_counter<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    executed: Executed<'_>,
    kernel: &LaneKernel,
    to: Reg,
    from: &[Reg; 3],
    counter: FloatCounter,
) {
    let registers = &batch.registers;
    let same = |lane: usize| {
        let words = 0..kernel.words;
        words.fold(true, |same, word| {
            let [sum, before] = [to, from[counter.operand]].map(|first| registers[first.plus(word)].0[lane]);
            same & (sum == before)
        })
    };
    let read = |lane| LaneOperands::read(registers, kernel, from, 0, lane);
    let stuck = Mask::from_fn(|lane| {
        batch.mask.contains(lane)
            && same(lane)
            && read(lane).float(counter.operand).is_finite()
            && read(lane).float(1 - counter.operand) != 0.0
    });
    let Some(lane) = stuck.lowest() else { return };
    let operation = read(lane).describe_operation(kernel);
    sanitizer.tell_of_program(batch, &arithmetic::FLOAT_COUNTER, executed.place.op, stuck, |program| {
        let name = program.module.name(counter.variable).unwrap_or("a float");
        format!("`{name}` counts no further: {operation} is the same number again")
    });
}

/// The number of the cause of a kernel's first operand that is a NaN or infinite in a lane.
fn special_operand<const W: usize>(
    registers: &Registers<W>,
    shadow: &ShadowRegisters<W>,
    kernel: &LaneKernel,
    from: &[Reg; 3],
    lane: usize,
) -> u32 {
    let mut floats = from.iter().zip(&kernel.float_operands).filter(|(_, width)| **width > 0);
    let special = floats.find(|&(&operand, &width)| special_lanes(registers, operand, width).contains(lane));
    special.map_or(NO_CAUSE, |(&operand, _)| shadow.cause(operand, lane))
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
        Flow::Merge => each[0] | each[1],
        Flow::Or { ones } => any.without(decided(ones)),
        Flow::Select => {
            let first = registers.mask(from[0]);
            each[0] | (each[1] & first) | each[2].without(first)
        }
    }
}
