//! Chains of sums and of products in another order: within formulas (`OpDot`, the products of
//! matrices, and what `GLSL.std.450` defines by them) always, across instructions where the module
//! allows it.
//!
//! A chain is known by its parts, the operands that are no links of it. It is evaluated anew, in an
//! order that is drawn for its instruction: the parts are shuffled, and neighbours are joined until
//! one is left. In formulas a product is joined with or without being rounded.

use crate::many_seeds::contraction::factors;
use crate::many_seeds::executed_kernel::ExecutedKernel;
use crate::many_seeds::float_arithmetic::{FloatArithmetic, sign_bit};
use crate::many_seeds::lane_bits::{set_words, words};
use crate::many_seeds::live_registers::LiveRegisters;
use anyhit_engine::machine::{Batch, ChoiceKind, OpenChoices};
use anyhit_engine::math::random::Random;

/// A chain with more parts ends, and its value is a part of the next: compilers reorder what stands
/// side by side, not the sums of long loops.
const MOST_PARTS: usize = 16;

/// Which operations a chain goes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ChainKind {
    /// The sums and products of a formula, the instruction at this word.
    Formula(u32),
    /// Sums and differences.
    Sum,
    /// Products alone.
    Product,
}

/// A part of a chain.
#[derive(Clone, Debug)]
struct Part {
    /// Whether it is subtracted.
    is_negated: bool,
    value: PartValue,
}

/// The value of a part, lane by lane.
#[derive(Clone, Debug)]
enum PartValue {
    /// A rounded value.
    Rounded(Vec<u64>),
    /// The factors of a product.
    Product(Vec<[u64; 2]>),
}

/// How the value of a register came about.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    kind: ChainKind,
    parts: Vec<Part>,
}

/// The chains that are in the registers of the batch that runs.
pub(super) type LiveChains = LiveRegisters<Chain>;

/// The value of a part in one lane.
#[derive(Clone, Copy, Debug)]
enum LanePart {
    Rounded(u64),
    Product(u64, u64),
}

/// Notes the chain that an operation continues, and evaluates it in another order, if that is
/// drawn.
pub(super) fn after<const W: usize>(
    executed: ExecutedKernel<'_>,
    choices: &OpenChoices,
    live: &mut LiveChains,
    arithmetic: &mut FloatArithmetic,
    batch: &mut Batch<W>,
) {
    let ExecutedKernel { kernel, to, from, licence, .. } = executed;
    let is_product = kernel.name == "FMul";
    let (chain_kind, choice, least) = match licence.is_formula {
        true => (ChainKind::Formula(licence.offset), ChoiceKind::DotOrder, 2),
        false if !licence.reassociates || kernel.name == "Fma" => return,
        false if is_product => (ChainKind::Product, ChoiceKind::Reassociation, 3),
        false => (ChainKind::Sum, ChoiceKind::Reassociation, 3),
    };
    if !choices.kinds.contains(&choice) {
        return;
    }
    if licence.is_formula && is_product {
        let value = PartValue::Product(factors(batch, kernel, from));
        let chain = Chain { kind: chain_kind, parts: vec![Part { is_negated: false, value }] };
        return live.set(to, chain, batch, |_| true);
    }
    let mut holds = vec![true; W];
    let mut parts = Vec::new();
    for (at, &register) in from[..2].iter().enumerate() {
        let is_negated = at == 1 && executed.is_difference();
        match live.get(register).filter(|known| known.made_of.kind == chain_kind) {
            Some(known) => {
                holds.iter_mut().enumerate().for_each(|(lane, holds)| *holds &= known.holds(lane));
                let own = known.made_of.parts.iter().cloned();
                parts.extend(own.map(|part| Part { is_negated: part.is_negated != is_negated, ..part }));
            }
            None => {
                let value = (0..W).map(|lane| words(batch, register, kernel.words, lane)).collect();
                parts.push(Part { is_negated, value: PartValue::Rounded(value) });
            }
        }
    }
    if parts.len() > MOST_PARTS {
        return;
    }
    let chain = Chain { kind: chain_kind, parts };
    let site = choices.site(choice, [0; 3], executed.place(choices));
    let enough = chain.parts.len() >= least;
    if let Some(random) = choices.draw(site).filter(|_| enough) {
        let width = kernel.float_result;
        let mut differs = false;
        for lane in batch.mask.lanes().filter(|&lane| holds[lane]) {
            let value = chain.evaluate(width, lane, random.clone(), arithmetic);
            differs |= value != words(batch, to, kernel.words, lane);
            set_words(batch, to, kernel.words, lane, value);
        }
        if differs {
            executed.note(choices, choice);
        }
    }
    live.set(to, chain, batch, |lane| holds[lane]);
}

impl Chain {
    /// Its value in a lane, in an order that is drawn.
    fn evaluate(&self, width: u32, lane: usize, mut random: Random, arithmetic: &mut FloatArithmetic) -> u64 {
        let mut parts: Vec<LanePart> = self.parts.iter().map(|part| part.of_lane(width, lane)).collect();
        random.shuffle(&mut parts);
        while parts.len() > 1 {
            let at = random.below(parts.len() as u64 - 1) as usize;
            let fuses = random.below(2) == 0;
            let joined = self.join([parts[at], parts[at + 1]], width, fuses, arithmetic);
            parts[at] = LanePart::Rounded(joined);
            parts.remove(at + 1);
        }
        parts.first().map_or(0, |part| part.rounded(width, arithmetic))
    }

    /// Two parts in one.
    fn join(&self, parts: [LanePart; 2], width: u32, fuses: bool, arithmetic: &mut FloatArithmetic) -> u64 {
        let [one, other] = parts;
        match (self.kind, one, other) {
            (ChainKind::Product, ..) => {
                let [one, other] = parts.map(|part| part.rounded(width, arithmetic));
                arithmetic.mul(width, one, other)
            }
            (_, LanePart::Product(a, b), rest) | (_, rest, LanePart::Product(a, b)) if fuses => {
                let rest = rest.rounded(width, arithmetic);
                arithmetic.fma(width, a, b, rest)
            }
            _ => {
                let [one, other] = parts.map(|part| part.rounded(width, arithmetic));
                arithmetic.add(width, one, other)
            }
        }
    }
}

impl Part {
    /// Its value in a lane, with its sign.
    fn of_lane(&self, width: u32, lane: usize) -> LanePart {
        let sign = if self.is_negated { sign_bit(width) } else { 0 };
        match &self.value {
            PartValue::Rounded(values) => LanePart::Rounded(values[lane] ^ sign),
            PartValue::Product(factors) => {
                let [a, b] = factors[lane];
                LanePart::Product(a ^ sign, b)
            }
        }
    }
}

impl LanePart {
    /// Its value, rounded.
    fn rounded(self, width: u32, arithmetic: &mut FloatArithmetic) -> u64 {
        match self {
            Self::Rounded(bits) => bits,
            Self::Product(a, b) => arithmetic.mul(width, a, b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rounded(value: f32) -> Part {
        Part { is_negated: false, value: PartValue::Rounded(vec![value.to_bits().into()]) }
    }

    fn values(chain: &Chain) -> std::collections::BTreeSet<u64> {
        let mut arithmetic = FloatArithmetic::default();
        (0..200).map(|seed| chain.evaluate(32, 0, Random::new(seed), &mut arithmetic)).collect()
    }

    fn bits(values: &[f32]) -> std::collections::BTreeSet<u64> {
        values.iter().map(|value| u64::from(value.to_bits())).collect()
    }

    #[test]
    fn sums_are_added_in_every_order() {
        // 2^24 + 1 is a tie and rounds to 2^24: (2^24 + 1) + 1 = 2^24, and 2^24 + (1 + 1) is exact.
        let great = 2f32.powi(24);
        let chain = Chain { kind: ChainKind::Sum, parts: [great, 1.0, 1.0].map(rounded).into() };
        assert_eq!(values(&chain), bits(&[great, great + 2.0]));
    }

    #[test]
    fn products_of_formulas_are_rounded_or_not() {
        // (1 + 2^-12)^2 = 1 + 2^-11 + 2^-24 rounds to 1 + 2^-11. A difference of two such products
        // is 0 where both are rounded, and else plus or minus 2^-24.
        let near = u64::from((1.0 + 2f32.powi(-12)).to_bits());
        let square = |is_negated| Part { is_negated, value: PartValue::Product(vec![[near; 2]]) };
        let chain = Chain { kind: ChainKind::Formula(0), parts: vec![square(false), square(true)] };
        let rest = 2f32.powi(-24);
        assert_eq!(values(&chain), bits(&[0.0, rest, -rest]));
    }

    #[test]
    fn products_are_multiplied_in_every_order() {
        // 2^100 * 2^100 overflows, unless 2^-100 comes between.
        let parts = [2f32.powi(100), 2f32.powi(100), 2f32.powi(-100)].map(rounded).into();
        let chain = Chain { kind: ChainKind::Product, parts };
        assert_eq!(values(&chain), bits(&[2f32.powi(100), f32::INFINITY]));
    }
}
