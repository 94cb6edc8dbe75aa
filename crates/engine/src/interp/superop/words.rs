//! The functions of superinstructions, from the words of one lane to a word.
//!
//! Functions are composed where the result of one is an operand of another and has no other use.
//! Each is rounded separately.
//!
//! They are applied to each lane, so they call nothing of the standard library that is not marked
//! `#[inline]`: from another codegen unit it would be a call for each lane.

use crate::machine::Scalar;
use crate::ops::lane_kernel::{Binary, Ternary, Unary};
use crate::ops::superop::Operands;

/// A function that reads the first [`WordFunction::OPERANDS`] words.
pub(super) trait WordFunction {
    /// How many operands it has.
    const OPERANDS: usize;
    /// The result; a NaN has the payload that the processor gave it.
    fn apply(words: Operands<u32>) -> u32;
}

/// The function of a lane kernel of one operand.
pub(super) struct UnaryWord<F>(F);
/// The function of a lane kernel of two operands.
pub(super) struct BinaryWord<F>(F);
/// The function of a lane kernel of three operands.
pub(super) struct TernaryWord<F>(F);

impl<F: Unary> WordFunction for UnaryWord<F> {
    const OPERANDS: usize = 1;
    #[inline(always)]
    fn apply([a, ..]: Operands<u32>) -> u32 {
        F::apply(F::A::from_words(a, 0)).to_word()
    }
}

impl<F: Binary> WordFunction for BinaryWord<F> {
    const OPERANDS: usize = 2;
    #[inline(always)]
    fn apply([a, b, ..]: Operands<u32>) -> u32 {
        F::apply(F::A::from_words(a, 0), F::B::from_words(b, 0)).to_word()
    }
}

impl<F: Ternary> WordFunction for TernaryWord<F> {
    const OPERANDS: usize = 3;
    #[inline(always)]
    fn apply([a, b, c, ..]: Operands<u32>) -> u32 {
        F::apply(F::A::from_words(a, 0), F::B::from_words(b, 0), F::C::from_words(c, 0)).to_word()
    }
}

/// `F`, then `G` with the result as its first operand; the other operands of `G` follow those of
/// `F`.
pub(super) struct Chain<F, G>(F, G);

impl<F: WordFunction, G: WordFunction> WordFunction for Chain<F, G> {
    const OPERANDS: usize = F::OPERANDS + G::OPERANDS - 1;
    #[inline(always)]
    fn apply(words: Operands<u32>) -> u32 {
        let mut second = [0; _];
        second[0] = F::apply(words);
        for at in 1..G::OPERANDS {
            second[at] = words[F::OPERANDS + at - 1];
        }
        G::apply(second)
    }
}

/// `F`, then `G` with the result as its last operand; the other operands of `G` follow those of
/// `F`.
pub(super) struct Last<F, G>(F, G);

impl<F: WordFunction, G: WordFunction> WordFunction for Last<F, G> {
    const OPERANDS: usize = F::OPERANDS + G::OPERANDS - 1;
    #[allow(clippy::manual_memcpy, reason = "`copy_from_slice` is not inlined")]
    #[inline(always)]
    fn apply(words: Operands<u32>) -> u32 {
        let mut second = [0; _];
        for at in 0..G::OPERANDS - 1 {
            second[at] = words[F::OPERANDS + at];
        }
        second[G::OPERANDS - 1] = F::apply(words);
        G::apply(second)
    }
}

/// `f = F(a, b)`, then `G(f, c)`.
pub(super) type Then<F, G> = Chain<F, G>;
/// `f = F(a)`, then `G(f, b)`.
pub(super) type ThenWith<F, G> = Chain<F, G>;
/// `f = F(a, b)`, then `G(c, f)`.
pub(super) type After<F, G> = Last<F, G>;

/// `f = F(a, b)`, then `G(a, f)`.
pub(super) struct WithItself<F, G>(F, G);

impl<F: WordFunction, G: WordFunction> WordFunction for WithItself<F, G> {
    const OPERANDS: usize = F::OPERANDS;
    #[inline(always)]
    fn apply(words: Operands<u32>) -> u32 {
        let mut second = [0; _];
        [second[0], second[1]] = [words[0], F::apply(words)];
        G::apply(second)
    }
}

/// `F(a, a)`.
pub(super) struct OnBothOperands<F>(F);

impl<F: WordFunction> WordFunction for OnBothOperands<F> {
    const OPERANDS: usize = 1;
    #[inline(always)]
    fn apply([a, ..]: Operands<u32>) -> u32 {
        let mut both = [0; _];
        [both[0], both[1]] = [a, a];
        F::apply(both)
    }
}

/// Returns its operand unchanged.
pub(super) struct Identity;

impl WordFunction for Identity {
    const OPERANDS: usize = 1;
    #[inline(always)]
    fn apply([a, ..]: Operands<u32>) -> u32 {
        a
    }
}

/// Replaces a NaN with the canonical NaN that registers hold.
pub(super) struct CanonicalNan;

impl WordFunction for CanonicalNan {
    const OPERANDS: usize = 1;
    #[inline(always)]
    fn apply([a, ..]: Operands<u32>) -> u32 {
        f32::from_bits(a).to_words().0
    }
}
