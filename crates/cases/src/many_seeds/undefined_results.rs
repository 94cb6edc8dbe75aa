//! Drawn results of operations whose operands leave their result undefined: a shift by too much,
//! the logarithm of a negative number. The sanitizer's rules say which (`sanitize::operand_check`).
//!
//! What has undefined *behaviour* is not drawn: a division of integers by zero, a float that does
//! not fit in the integer that it is converted to.

use rustc_hash::FxHashMap;

use crate::many_seeds::lane_bits::{set_words, words};
use crate::many_seeds::word_kind::WordKind;
use anyhit_engine::machine::{Batch, ChoiceKind, DrawnDetails, OpIndex, OpenChoices};
use anyhit_engine::math::random::Random;
use anyhit_engine::ops::lane_kernel::LaneKernel;
use anyhit_engine::ops::op::Op;
use anyhit_engine::program::Program;
use anyhit_sanitize::lane_operands::LaneOperands;
use anyhit_sanitize::operand_check::OperandCheck;
use anyhit_sanitize::plan::{FastMath, OpPlan};
use anyhit_sanitize::rule::arithmetic;
use anyhit_sanitize::{Level, Levels, ProgramPlan, RuleKind};

/// The operations of a program whose results may be undefined.
#[derive(Debug)]
pub(super) struct UndefinedResults {
    by_op: FxHashMap<OpIndex, OpenResult>,
}

/// An operation whose result may be undefined.
#[derive(Debug)]
struct OpenResult {
    /// The words of its instruction.
    offset: u32,
    /// The rules about its operands, without those that the scene allows to be broken.
    checks: Vec<&'static OperandCheck>,
    /// What a decoration promises of operands and result.
    fast_math: FastMath,
    /// Bits of a scalar of the instruction's result.
    result_width: u32,
}

impl UndefinedResults {
    /// Those of the program of a plan; a result that is undefined by a rule at level `allow` is not
    /// drawn.
    pub(super) fn of(plan: &ProgramPlan, levels: &Levels) -> Self {
        let Program { ops, origins, .. } = &*plan.program;
        let is_told = |check: &&'static OperandCheck| {
            check.rule.kind == RuleKind::UndefinedValue && levels.of(check.rule) != Level::Allow
        };
        let open = |((at, op), step): ((usize, &Op), &OpPlan)| {
            let Op::LaneKernel { .. } = op else { return None };
            let promises = levels.of(&arithmetic::FASTMATH_FLAGS) != Level::Allow;
            let checks: Vec<_> = step.checks.iter().map(|open| open.check).filter(is_told).collect();
            let fast_math = if promises { step.fast_math } else { FastMath::default() };
            let is_open = !checks.is_empty() || !fast_math.is_none();
            let (offset, result_width) = (origins.get(at)?.offset, step.result_width);
            is_open.then(|| (OpIndex::new(at), OpenResult { offset, checks, fast_math, result_width }))
        };
        Self { by_op: ops.iter().enumerate().zip(&plan.steps).filter_map(open).collect() }
    }

    /// Draws the results of an operation where its operands leave them undefined.
    pub(super) fn after<const W: usize>(
        &self,
        choices: &OpenChoices,
        op: OpIndex,
        executed: &Op,
        batch: &mut Batch<W>,
    ) {
        let Op::LaneKernel { kernel, to, from } = executed else { return };
        let Some(open) = self.by_op.get(&op) else { return };
        let place = u64::from(choices.shader.0) << 32 | u64::from(open.offset);
        for lane in batch.mask.lanes() {
            let read = |lane| LaneOperands::read(&batch.registers, kernel, from, open.result_width, lane);
            let operands = read(lane);
            let result = words(batch, *to, kernel.words, lane);
            let Some(why) = open.undefined(kernel, &operands, result) else { continue };
            let launch_id = batch.invocations.launch_id(lane);
            let site = choices.site(ChoiceKind::UndefinedResult, launch_id, place);
            let Some(mut random) = choices.draw(site) else { continue };
            let kind = WordKind::of_result(kernel, open.result_width);
            let drawn = match is_one_of_the_operands(&why, kernel) {
                Some(count) => operands.unsigned(random.below(count) as usize),
                None => any(kind, kernel.words, &mut random),
            };
            if drawn == result {
                continue;
            }
            set_words(batch, *to, kernel.words, lane, drawn);
            let what = || match why {
                Why::Operands(check) => {
                    format!("the result is undefined: {} ({})", (check.message)(&operands), check.rule.id)
                }
                Why::Promise(flag) => format!("the result is undefined: the operation is decorated {flag}"),
            };
            choices.note(site, || {
                let (shader, what) = (choices.shader, Some(what()));
                DrawnDetails::Value { shader, op: Some(op), what }
            });
        }
    }
}

/// Why a result is undefined.
#[derive(Clone, Copy, Debug)]
enum Why {
    /// The operands break a rule.
    Operands(&'static OperandCheck),
    /// An operand or the result is what a decoration says that it is not.
    Promise(&'static str),
}

impl OpenResult {
    /// Why the result of the operation is undefined, if it is.
    fn undefined(&self, kernel: &LaneKernel, operands: &LaneOperands, result: u64) -> Option<Why> {
        let broken = self.checks.iter().find(|check| (check.breaks)(operands));
        if let Some(check) = broken {
            return Some(Why::Operands(check));
        }
        if self.fast_math.is_none() {
            return None;
        }
        let floats = (0..3).filter(|&at| kernel.float_operands[at] > 0).map(|at| operands.float(at));
        let result = match kernel.float_result {
            16 => Some(half::f16::from_bits(result as u16).to_f64()),
            32 => Some(f64::from(f32::from_bits(result as u32))),
            64 => Some(f64::from_bits(result)),
            _ => None,
        };
        let mut floats = floats.chain(result);
        let FastMath { not_nan, not_infinite } = self.fast_math;
        floats.find_map(|float| match float {
            _ if not_nan && float.is_nan() => Some(Why::Promise("NotNaN")),
            _ if not_infinite && float.is_infinite() => Some(Why::Promise("NotInf")),
            _ => None,
        })
    }
}

/// From how many of the operands the result is chosen, where that is all that is undefined: "which
/// operand is the result is undefined if one of the operands is a NaN" (`GLSL.std.450`).
fn is_one_of_the_operands(why: &Why, kernel: &LaneKernel) -> Option<u64> {
    match (why, kernel.name) {
        (Why::Operands(check), "FMin" | "FMax" | "FClamp") if check.rule == &arithmetic::MINMAX_NAN => {
            Some(kernel.operands.iter().filter(|&&words| words > 0).count() as u64)
        }
        _ => None,
    }
}

/// Any value of a kind in so many words.
fn any(kind: WordKind, words: u32, random: &mut Random) -> u64 {
    let mut word = || u64::from(kind.draw(random).unwrap_or(0));
    let low = word();
    if words > 1 { low | word() << 32 } else { low }
}
