//! Sums of products with one rounding instead of two, where the module allows it.

use crate::many_seeds::executed_kernel::ExecutedKernel;
use crate::many_seeds::float_arithmetic::{FloatArithmetic, sign_bit};
use crate::many_seeds::lane_bits::{set_words, words};
use crate::many_seeds::live_registers::LiveRegisters;
use anyhit_engine::machine::{Batch, ChoiceKind, OpenChoices, Reg};
use anyhit_engine::ops::lane_kernel::LaneKernel;

/// The factors of a product, lane by lane.
pub(super) type Factors = Vec<[u64; 2]>;

/// The products in the registers of the batch that runs.
pub(super) type LiveProducts = LiveRegisters<Factors>;

/// The factors of a product that was executed.
pub(super) fn factors<const W: usize>(batch: &Batch<W>, kernel: &LaneKernel, from: &[Reg; 3]) -> Factors {
    let factor = |at: usize, lane| words(batch, from[at], kernel.words, lane);
    (0..W).map(|lane| [factor(0, lane), factor(1, lane)]).collect()
}

/// Notes the factors of a product, or recomputes a sum with a product that is not rounded, if that
/// is drawn. Returns whether the sum was.
pub(super) fn after<const W: usize>(
    executed: ExecutedKernel<'_>,
    choices: &OpenChoices,
    live: &mut LiveProducts,
    arithmetic: &mut FloatArithmetic,
    batch: &mut Batch<W>,
) -> bool {
    let ExecutedKernel { kernel, to, from, licence, .. } = executed;
    if !licence.contracts || licence.is_formula {
        return false;
    }
    match kernel.name {
        "FMul" => {
            live.set(to, factors(batch, kernel, from), batch, |_| true);
            false
        }
        "Fma" => fuse(executed, choices, arithmetic, batch),
        _ => contract(executed, choices, live, arithmetic, batch),
    }
}

/// Recomputes a sum, if that is drawn, in the lanes where an operand is a product.
fn contract<const W: usize>(
    executed: ExecutedKernel<'_>,
    choices: &OpenChoices,
    live: &LiveProducts,
    arithmetic: &mut FloatArithmetic,
    batch: &mut Batch<W>,
) -> bool {
    let ExecutedKernel { kernel, to, from, .. } = executed;
    let [first, second] = [from[0], from[1]].map(|register| live.get(register));
    if first.is_none() && second.is_none() {
        return false;
    }
    let site = choices.site(ChoiceKind::Contraction, [0; 3], executed.place(choices));
    // Of two products one at most is left unrounded.
    let Some(which) = choices.draw(site).map(|mut random| random.below(3)) else { return false };
    let (at, product) = match (which, first, second) {
        (0, Some(product), _) => (0, product),
        (1, _, Some(product)) => (1, product),
        _ => return false,
    };
    let width = kernel.float_result;
    let sign = |negated: bool| if negated { sign_bit(width) } else { 0 };
    let signs = [sign(executed.is_difference() && at == 1), sign(executed.is_difference() && at == 0)];
    let mut differs = false;
    for lane in batch.mask.lanes().filter(|&lane| product.holds(lane)) {
        let other = words(batch, from[1 - at], kernel.words, lane);
        let [a, b] = product.made_of[lane];
        let fused = arithmetic.fma(width, a ^ signs[0], b, other ^ signs[1]);
        differs |= fused != words(batch, to, kernel.words, lane);
        set_words(batch, to, kernel.words, lane, fused);
    }
    if differs {
        executed.note(choices, ChoiceKind::Contraction);
    }
    differs
}

/// Recomputes `Fma` with one rounding, if that is drawn; this crate rounds twice.
fn fuse<const W: usize>(
    executed: ExecutedKernel<'_>,
    choices: &OpenChoices,
    arithmetic: &mut FloatArithmetic,
    batch: &mut Batch<W>,
) -> bool {
    let ExecutedKernel { kernel, to, from, .. } = executed;
    let site = choices.site(ChoiceKind::Contraction, [0; 3], executed.place(choices));
    if choices.draw(site).is_none_or(|mut random| random.below(2) == 0) {
        return false;
    }
    let mut differs = false;
    for lane in batch.mask.lanes() {
        let [a, b, c] = from.map(|register| words(batch, register, kernel.words, lane));
        let fused = arithmetic.fma(kernel.float_result, a, b, c);
        differs |= fused != words(batch, to, kernel.words, lane);
        set_words(batch, to, kernel.words, lane, fused);
    }
    if differs {
        executed.note(choices, ChoiceKind::Contraction);
    }
    differs
}
