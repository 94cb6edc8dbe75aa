//! Where NaNs and infinities are made, how their causes go from operands to results, and the places
//! where they are told.

use crate::machine::{Batch, Mask, NO_CAUSE, OpIndex, Reg, ShadowRegisters};
use crate::ops::lane_kernel::LaneKernel;
use crate::sanitize::cause::{Cause, CauseDetails, OpPlace, Special};
use crate::sanitize::checks::lanes::{nan_lanes, special_lanes};
use crate::sanitize::lane_operands::LaneOperands;
use crate::sanitize::plan::Executed;
use crate::sanitize::report::specials::SpecialSink;
use crate::sanitize::rule::{Rule, arithmetic};
use crate::sanitize::sanitizer::Sanitizer;

/// Keeps where the NaNs and infinities of a kernel's result were made.
#[inline]
pub(super) fn note<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    kernel: &LaneKernel,
    to: Reg,
    from: &[Reg; 3],
) {
    let registers = &batch.registers;
    let specials = special_lanes(registers, to, kernel.float_result) & batch.mask;
    let specials = specials.without(shadow.undefined(to));
    if !specials.is_empty() {
        note_specials(sanitizer, batch, shadow, executed, kernel, (to, from), specials);
    }
}

/// Keeps where the NaNs and infinities in some lanes of a kernel's result were made.
#[cold]
fn note_specials<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    kernel: &LaneKernel,
    (to, from): (Reg, &[Reg; 3]),
    specials: Mask<W>,
) {
    let registers = &batch.registers;
    let nans = nan_lanes(registers, to, kernel.float_result) & specials;
    let mut born = specials;
    let mut operands = Mask::NONE;
    shadow.set_cause(to, specials, NO_CAUSE);
    for (&operand, &width) in from.iter().zip(&kernel.float_operands).filter(|(_, width)| **width > 0) {
        let special = special_lanes(registers, operand, width) & born;
        // A NaN that is made of an infinity is born here; that operand is told with it.
        let inherited = special.without(nans.without(nan_lanes(registers, operand, width)));
        shadow.copy_causes(to, operand, inherited | special.without(operands));
        operands = operands | special;
        born = born.without(inherited);
    }
    for (lanes, special) in [(born & nans, Special::Nan), (born.without(nans), Special::Infinity)] {
        let Some(lane) = lanes.lowest() else { continue };
        let operands_of = || LaneOperands::read(registers, kernel, from, 0, lane);
        let Some(rule) = rule_of(special, executed.step.preserves_special, kernel, operands_of()) else {
            shadow.set_cause(to, lanes, NO_CAUSE);
            continue;
        };
        let operand = if operands.contains(lane) { shadow.cause(to, lane) } else { NO_CAUSE };
        let number = sanitizer.cause(Cause::Born { place: executed.place, special }, || {
            let message = operands_of().describe_operation(kernel);
            Some(CauseDetails { rule, message, operand })
        });
        shadow.set_cause(to, lanes, number);
    }
}

/// The rule that tells of a NaN or an infinity that a kernel has made, where it is told at all.
fn rule_of(
    special: Special,
    preserves: bool,
    kernel: &LaneKernel,
    operands: LaneOperands,
) -> Option<&'static Rule> {
    // A NaN or infinity that is unpacked from bits was there before.
    if kernel.name != "Convert" && kernel.float_operands == [0; 3] {
        return None;
    }
    let divides = kernel.name.trim_end_matches("TowardZero") == "FDiv";
    match special {
        Special::Nan if divides && !preserves => Some(&arithmetic::ULP_DOMAIN),
        Special::Nan => Some(&arithmetic::NAN_OUTPUT),
        Special::Infinity if preserves => None,
        Special::Infinity if divides && operands.float(1) == 0.0 => Some(&arithmetic::FDIV_ZERO),
        Special::Infinity => Some(&arithmetic::FASTMATH_DEFAULT),
    }
}

/// Takes the causes of NaNs and infinities over from the chosen operand of a select.
pub(super) fn select<const W: usize>(
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    to: Reg,
    from: &[Reg; 3],
) {
    let specials = special_lanes(&batch.registers, to, 32) & batch.mask;
    let specials = specials.without(shadow.undefined(to));
    if !specials.is_empty() {
        let first = batch.registers.mask(from[0]);
        shadow.copy_causes(to, from[1], specials & first);
        shadow.copy_causes(to, from[2], specials.without(first));
    }
}

/// Reports NaNs and infinities of a register of 32 bits that reach something, if an instruction
/// made them.
pub(in crate::sanitize) fn reach<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &ShadowRegisters<W>,
    op: OpIndex,
    register: Reg,
    lanes: Mask<W>,
    sink: SpecialSink,
) {
    let lanes = (lanes & shadow.caused(register)).without(shadow.undefined(register));
    if lanes.is_empty() {
        return;
    }
    let found = match sink {
        SpecialSink::Comparison | SpecialSink::ReportedT => nan_lanes(&batch.registers, register, 32),
        _ => special_lanes(&batch.registers, register, 32),
    };
    let found = found & lanes;
    if !found.is_empty() {
        sanitizer.reporter(batch).special(shadow, op, register, found, sink);
    }
}

/// Reports a comparison with a NaN that an instruction has made.
pub(super) fn compare<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &ShadowRegisters<W>,
    place: OpPlace,
    kernel: &LaneKernel,
    from: &[Reg; 3],
) {
    for (&operand, &width) in from.iter().zip(&kernel.float_operands).filter(|(_, width)| **width > 0) {
        let nans =
            (nan_lanes(&batch.registers, operand, width) & batch.mask).without(shadow.undefined(operand));
        if !nans.is_empty() {
            let sink = SpecialSink::Comparison;
            sanitizer.reporter(batch).special(shadow, place.op, operand, nans, sink);
        }
    }
}
