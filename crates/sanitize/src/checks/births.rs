//! Where NaNs and infinities are made, how their causes go from operands to results, and the places
//! where they are told.

use crate::cause::{Cause, CauseDetails, OpPlace, Special};
use crate::checks::lanes::{nan_lanes, special_lanes};
use crate::lane_operands::LaneOperands;
use crate::plan::Executed;
use crate::report::specials::SpecialSink;
use crate::rule::{Rule, arithmetic};
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Mask, NO_CAUSE, OpIndex, Reg, ShadowRegisters};
use anyhit_engine::ops::bit::{BitwiseAnd, ShiftRightArithmetic, ShiftRightLogical, field};
use anyhit_engine::ops::conversion::CONVERT;
use anyhit_engine::ops::float_controls::rounded_family;
use anyhit_engine::ops::glsl::parts;
use anyhit_engine::ops::lane_kernel::{LaneKernel, OpFamily};
use anyhit_engine::ops::subgroup::subgroups;
use anyhit_engine::ops::{arithmetic as arithmetic_ops, glsl};

/// Kernels of integers that keep some bits of an operand only.
static CUTTERS: [&OpFamily; 6] = [
    &BitwiseAnd,
    &ShiftRightLogical,
    &ShiftRightArithmetic,
    &field::FieldUExtract,
    &field::FieldSExtract,
    &CONVERT,
];

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
    if kernel.words == 2 {
        shadow.copy_causes(to.plus(1), to, specials);
    }
}

/// Takes the causes of NaNs and infinities over to what is made of their bits.
#[cold]
pub(super) fn carry<const W: usize>(
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    kernel: &LaneKernel,
    to: Reg,
    from: &[Reg; 3],
) {
    let registers = &batch.registers;
    let mut open = batch.mask.without(shadow.undefined(to));
    if kernel.float_result > 0 {
        // Of a number no bits of a NaN are left.
        open = open & special_lanes(registers, to, kernel.float_result);
    } else if kernel.is_one_of(&CUTTERS) {
        let holds =
            |lane: usize| (0..kernel.words).any(|word| holds_special(registers[to.plus(word)].0[lane]));
        open = Mask::from_fn(|lane| open.contains(lane) && holds(lane));
    }
    let is_clamped = kernel.is_one_of(&[&parts::Snorm8, &parts::Unorm8, &parts::Snorm16, &parts::Unorm16]);
    for (at, &operand) in from.iter().enumerate() {
        for word in 0..kernel.operands[at] {
            let register = operand.plus(word);
            let mut lanes = (shadow.caused(register) & open).without(shadow.undefined(register));
            // An infinity is clamped to the greatest number of the format.
            if is_clamped {
                lanes = lanes & nan_lanes(registers, register, 32);
            }
            (0..kernel.words).for_each(|word| shadow.copy_causes(to.plus(word), register, lanes));
            open = open.without(lanes);
        }
    }
}

/// Whether the bits of a word, or of one of its halves, are those of a NaN or an infinity of 32 or
/// 16 bits.
fn holds_special(word: u32) -> bool {
    let is_special = |bits: u32, exponent: u32| bits & exponent == exponent;
    is_special(word, 0x7F80_0000) || is_special(word, 0x7C00) || is_special(word, 0x7C00_0000)
}

/// Keeps where the NaNs and infinities of a reduction's result were made: the operands of lanes are
/// those of others, too.
pub(super) fn reduce<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    kernel: &LaneKernel,
    [to, value]: [Reg; 2],
) {
    let (registers, words, width) = (&batch.registers, kernel.words, kernel.float_result);
    let specials = |register: Reg| match width {
        0 => Mask::NONE,
        width => special_lanes(registers, register, width) & batch.mask,
    };
    let (results, operands) = (specials(to), specials(value));
    let caused = (shadow.caused(value) & batch.mask).without(shadow.undefined(value));
    if results.is_empty() && caused.is_empty() {
        return;
    }
    let nans = |register: Reg| if width > 0 { nan_lanes(registers, register, width) } else { Mask::NONE };
    let (nan_results, nan_operands) = (nans(to), nans(value));
    let value_of = |register: Reg, lane: usize| registers.lane_words(register, words, lane);
    let adds = [&arithmetic_ops::FAdd, &arithmetic_ops::FMul].contains(&rounded_family(kernel));
    for members in subgroups(batch) {
        for &(lane, _) in &members {
            let gives = |source: usize| match width {
                // What is no minimum or maximum is made of all operands.
                0 if kernel.is_one_of(&[&glsl::SMin, &glsl::SMax, &glsl::UMin, &glsl::UMax]) => {
                    value_of(value, source).eq(value_of(to, lane))
                }
                0 => true,
                _ => results.contains(lane) && nan_operands.contains(source) >= nan_results.contains(lane),
            };
            let mut sources = members.iter().map(|member| member.0);
            let source = sources.find(|&source| caused.contains(source) && gives(source));
            if let Some(source) = source {
                let number = shadow.cause(value, source);
                (0..words).for_each(|word| shadow.set_cause(to.plus(word), Mask::lane(lane), number));
                continue;
            }
            let (special, given) = match nan_results.contains(lane) {
                true => (Special::Nan, nan_operands),
                false => (Special::Infinity, operands),
            };
            if !adds || !results.contains(lane) || members.iter().any(|member| given.contains(member.0)) {
                continue;
            }
            let rule = match special {
                Special::Nan => &arithmetic::NAN_OUTPUT,
                Special::Infinity if executed.step.preserves_special => continue,
                Special::Infinity => &arithmetic::FASTMATH_DEFAULT,
            };
            let number = sanitizer.cause(Cause::Born { place: executed.place, special }, || {
                let message = format!("{} over the lanes of a subgroup", kernel.name);
                Some(CauseDetails { rule, message, operand: NO_CAUSE })
            });
            (0..words).for_each(|word| shadow.set_cause(to.plus(word), Mask::lane(lane), number));
        }
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
    if !kernel.is(&CONVERT) && kernel.float_operands == [0; 3] {
        return None;
    }
    let divides = *rounded_family(kernel) == arithmetic_ops::FDiv;
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
    let lanes = batch.mask.without(shadow.undefined(to));
    let first = batch.registers.mask(from[0]);
    shadow.copy_causes(to, from[1], lanes & first);
    shadow.copy_causes(to, from[2], lanes.without(first));
}

/// Reports NaNs and infinities of a register, or what is made of their bits, that reach something,
/// if an instruction made them.
pub(crate) fn reach<const W: usize>(
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
        SpecialSink::Ray(_) | SpecialSink::Sample(_) => special_lanes(&batch.registers, register, 32),
        SpecialSink::Attributes
        | SpecialSink::Buffer
        | SpecialSink::Image(_)
        | SpecialSink::Print
        | SpecialSink::Payload => lanes,
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
