//! Functions as superinstructions apply them: from the words of one lane to a word.

use crate::machine::Scalar;
use crate::ops::lane_kernel::{Binary, Ternary, Unary};
use crate::ops::superop::Operands;

/// A function of words, of which the first [`WordFunction::OPERANDS`] count.
pub trait WordFunction {
    const OPERANDS: usize;
    /// The result, a NaN as the processor made it.
    fn apply(words: Operands<u32>) -> u32;
}

pub struct UnaryWord<F>(F);
pub struct BinaryWord<F>(F);
pub struct TernaryWord<F>(F);

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

/// A function, then another one whose first operand is what that gave.
pub struct Chain<F, G>(F, G);

impl<F: WordFunction, G: WordFunction> WordFunction for Chain<F, G> {
    const OPERANDS: usize = F::OPERANDS + G::OPERANDS - 1;
    #[inline(always)]
    fn apply(words: Operands<u32>) -> u32 {
        let mut second = Operands::default();
        second[0] = F::apply(words);
        second[1..G::OPERANDS].copy_from_slice(&words[F::OPERANDS..Self::OPERANDS]);
        G::apply(second)
    }
}

/// A function, then another one whose last operand is what that gave; its own others stand behind
/// those of the first.
pub struct Last<F, G>(F, G);

impl<F: WordFunction, G: WordFunction> WordFunction for Last<F, G> {
    const OPERANDS: usize = F::OPERANDS + G::OPERANDS - 1;
    #[inline(always)]
    fn apply(words: Operands<u32>) -> u32 {
        let mut second = Operands::default();
        second[..G::OPERANDS - 1].copy_from_slice(&words[F::OPERANDS..Self::OPERANDS]);
        second[G::OPERANDS - 1] = F::apply(words);
        G::apply(second)
    }
}

/// A function of a value and the same value.
pub struct WithBoth<F>(F);

impl<F: Binary<B = <F as Binary>::A>> Unary for WithBoth<F> {
    type A = F::A;
    type R = F::R;
    #[inline(always)]
    fn apply(a: F::A) -> F::R {
        F::apply(a, a)
    }
}

/// A value as it is.
pub struct Same;

impl Unary for Same {
    type A = u32;
    type R = u32;
    #[inline(always)]
    fn apply(a: u32) -> u32 {
        a
    }
}

/// A float as registers write it: every NaN the same.
pub struct Settled;

impl Unary for Settled {
    type A = u32;
    type R = u32;
    #[inline(always)]
    fn apply(a: u32) -> u32 {
        f32::from_bits(a).to_words().0
    }
}
