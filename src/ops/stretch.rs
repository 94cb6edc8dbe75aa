//! Steps of regular operations, run without leaving one loop.
//!
//! Most of what a shader does are some ninety regular instructions on 32-bit values, and moves. A
//! [`Step`] names one of them by a code, and its loop over the lanes stands in the arm of one `match`,
//! compiled for the processor's vectors as a whole. The result of each step stays in an *accumulator*, a
//! row that the compiler keeps in vector registers from one step to the next: where a step needs what
//! the one before it gave, nothing is loaded, and what nobody else needs is never stored. Frequent pairs
//! and chains of them have a code together, as the way from step to step takes time, too; each operation of them rounds as
//! it does by itself.
//!
//! Rows write every NaN as the same bits ([`crate::machine::Scalar::to_words`]); here that is a step of its
//! own, `Settled`, and stands only behind results whose bits somebody may see: an operation on floats
//! takes every NaN for the same.
//!
//! `plan` makes the steps. Rows without a code are called as ever, irregular operations end a stretch. Only what takes few
//! vector registers has a code: one arm that takes all sixteen, and the compiler keeps the accumulator in
//! memory in every arm.

mod pairs;
mod plan;

use std::ops::Range;

use crate::machine::lanes::Lanes;
use crate::machine::{Mask, Registers, Scalar};
use crate::math::vectors::{Task, Vectors};
use crate::ops::conversion::{self, Between, Conversion};
use crate::ops::op::Op;
use crate::ops::relational_logical::select;
use crate::ops::row::{Binary, Bits, Row, Ternary, Unary, Width};
use crate::ops::{arithmetic, bit, glsl, relational_logical as logical};
use pairs::{After, Shape, Then, ThenWith, WithItself};
pub use plan::{Fate, takes_float};

/// What a stretch does at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// The function, which operand the accumulator is, and whether the result goes to its row, too.
    code: u16,
    to: u16,
    from: Operands<u16>,
}

/// Of a step: three are what one operation has, chains of patterns have more. With eight the compiler loads their numbers as
/// one vector and takes it apart, which takes longer.
type Operands<T> = [T; 6];

/// The operations of a program in steps.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Steps {
    steps: Vec<Step>,
    /// The operation of each step.
    ops: Vec<u32>,
    /// The step with which each operation begins, and one more.
    first: Vec<u32>,
    /// Whether a step names a row behind the window.
    wide: bool,
}

/// The rows that steps name: a window, in which a number of one byte is always inside, or any.
trait Rows<const W: usize> {
    fn row(&self, number: u16) -> &Lanes<W>;
    fn row_mut(&mut self, number: u16) -> &mut Lanes<W>;
}

/// How many rows a window has.
pub const WINDOW: usize = 256;

impl<const W: usize> Rows<W> for [Lanes<W>; WINDOW] {
    #[inline(always)]
    fn row(&self, number: u16) -> &Lanes<W> {
        &self[usize::from(number as u8)]
    }

    #[inline(always)]
    fn row_mut(&mut self, number: u16) -> &mut Lanes<W> {
        &mut self[usize::from(number as u8)]
    }
}

impl<const W: usize> Rows<W> for [Lanes<W>] {
    #[inline(always)]
    fn row(&self, number: u16) -> &Lanes<W> {
        &self[usize::from(number)]
    }

    #[inline(always)]
    fn row_mut(&mut self, number: u16) -> &mut Lanes<W> {
        &mut self[usize::from(number)]
    }
}

/// A function of words, of which the first [`Words::OPERANDS`] count.
trait Words {
    const OPERANDS: usize;
    /// The result, a NaN as the processor made it.
    fn apply(words: Operands<u32>) -> u32;
}

struct One<F>(F);
struct Two<F>(F);
struct Three<F>(F);

impl<F: Unary> Words for One<F> {
    const OPERANDS: usize = 1;
    #[inline(always)]
    fn apply([a, ..]: Operands<u32>) -> u32 {
        F::apply(F::A::from_words(a, 0)).to_word()
    }
}

impl<F: Binary> Words for Two<F> {
    const OPERANDS: usize = 2;
    #[inline(always)]
    fn apply([a, b, ..]: Operands<u32>) -> u32 {
        F::apply(F::A::from_words(a, 0), F::B::from_words(b, 0)).to_word()
    }
}

impl<F: Ternary> Words for Three<F> {
    const OPERANDS: usize = 3;
    #[inline(always)]
    fn apply([a, b, c, ..]: Operands<u32>) -> u32 {
        F::apply(F::A::from_words(a, 0), F::B::from_words(b, 0), F::C::from_words(c, 0)).to_word()
    }
}

/// A function, then another one whose first operand is what that gave.
struct Chain<F, G>(F, G);

impl<F: Words, G: Words> Words for Chain<F, G> {
    const OPERANDS: usize = F::OPERANDS + G::OPERANDS - 1;
    #[inline(always)]
    fn apply(words: Operands<u32>) -> u32 {
        let mut second = Operands::default();
        second[0] = F::apply(words);
        second[1..G::OPERANDS].copy_from_slice(&words[F::OPERANDS..Self::OPERANDS]);
        G::apply(second)
    }
}

/// A function, then another one whose last operand is what that gave; its own others stand behind those of the first.
struct Last<F, G>(F, G);

impl<F: Words, G: Words> Words for Last<F, G> {
    const OPERANDS: usize = F::OPERANDS + G::OPERANDS - 1;
    #[inline(always)]
    fn apply(words: Operands<u32>) -> u32 {
        let mut second = Operands::default();
        second[..G::OPERANDS - 1].copy_from_slice(&words[F::OPERANDS..Self::OPERANDS]);
        second[G::OPERANDS - 1] = F::apply(words);
        G::apply(second)
    }
}

/// A value as it is.
struct Same;

impl Unary for Same {
    type A = u32;
    type R = u32;
    #[inline(always)]
    fn apply(a: u32) -> u32 {
        a
    }
}

/// A float as rows write it: every NaN the same.
struct Settled;

impl Unary for Settled {
    type A = u32;
    type R = u32;
    #[inline(always)]
    fn apply(a: u32) -> u32 {
        f32::from_bits(a).to_words().0
    }
}

/// The accumulator takes what a function gives of rows, and of what it held, which is operand `AT` (none
/// for 0); the result goes to its row, too, where it is `STORED`.
#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[inline(always)]
fn apply<const W: usize, F: Words, const AT: usize, const STORED: bool>(
    accumulator: &mut [u32; W],
    rows: &mut (impl Rows<W> + ?Sized),
    step: &Step,
) {
    let held = Lanes(*accumulator);
    let row = |at: usize| {
        if at < F::OPERANDS && at + 1 != AT { rows.row(step.from[at]) } else { &held }
    };
    let [a, b, c, d, e, f] = std::array::from_fn(row);
    let mut result = [0; W];
    for lane in 0..W {
        result[lane] = F::apply([a.0[lane], b.0[lane], c.0[lane], d.0[lane], e.0[lane], f.0[lane]]);
    }
    if STORED {
        rows.row_mut(step.to).0 = result;
    }
    *accumulator = result;
}

/// Floats to integers likewise: the processor's conversion of eight is none that the compiler makes of a loop.
#[inline(always)]
fn to_integers<const W: usize, V: Vectors, const AT: usize, const STORED: bool>(
    vectors: V,
    accumulator: &mut [u32; W],
    rows: &mut (impl Rows<W> + ?Sized),
    step: &Step,
) {
    const { assert!(W.is_multiple_of(8)) }
    let held = *accumulator;
    let floats = if AT == 0 { &rows.row(step.from[0]).0 } else { &held };
    let mut result = [0; W];
    for (eight, to) in floats.as_chunks::<8>().0.iter().zip(result.as_chunks_mut::<8>().0) {
        *to = vectors.to_integers(vectors.load(&eight.map(f32::from_bits))).map(|integer| integer as u32);
    }
    if STORED {
        rows.row_mut(step.to).0 = result;
    }
    *accumulator = result;
}

/// Stores the accumulator, or a row; where not every lane runs, for those whose word is all ones.
#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[inline(always)]
fn store<const W: usize, const AT: usize>(
    accumulator: &mut [u32; W],
    rows: &mut (impl Rows<W> + ?Sized),
    step: &Step,
    running: Option<&Lanes<W>>,
) {
    if AT == 0 {
        *accumulator = rows.row(step.from[0]).0;
    }
    let to = rows.row_mut(step.to);
    match running {
        None => to.0 = *accumulator,
        Some(running) => {
            for lane in 0..W {
                let mask = running.0[lane];
                to.0[lane] = accumulator[lane] & mask | to.0[lane] & !mask;
            }
        }
    }
}

/// Codes of a function: the operand that is the accumulator, and whether the result is stored.
const fn code(function: Function, at: usize, stored: bool) -> u16 {
    (function as u16) << 3 | (at as u16) << 1 | stored as u16
}

macro_rules! functions {
    (
        unary { $($unary:ident $unary_section:ident $unary_type:ident,)* }
        commuting { $($commuting:ident $commuting_section:ident $commuting_type:ident,)* }
        binary { $($binary:ident $binary_section:ident $binary_type:ident,)* }
        ternary { $($ternary:ident $ternary_section:ident $ternary_type:ident,)* }
        conversions { $($conversion:ident $from:ident $into:ident,)* }
        two { $($two:ident $two_shape:ident $two_first:ident $two_second:ident $two_type:ty;)* }
        three { $($three:ident $three_shape:ident $three_first:ident $three_second:ident $three_type:ty;)* }
        chains { $($chain:ident $chain_shape:ident $chain_first:ident $chain_second:ident $chain_type:ty;)* }
    ) => {
        /// What a step calculates.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        enum Function {
            Move,
            MoveMasked,
            Settle,
            /// What both of these do.
            SettleMasked,
            FToS,
            $($unary,)* $($commuting,)* $($binary,)* $($ternary,)* $($conversion,)* $($two,)* $($three,)* $($chain,)*
            /// Ends a stretch; behind all others, so that those begin with 0.
            Other,
        }

        /// Codes by the names of their functions, as patterns.
        #[allow(non_snake_case)]
        mod codes {
            functions! { @codes Move MoveMasked Settle SettleMasked FToS
                $($unary)* $($commuting)* $($binary)* $($ternary)* $($conversion)* $($two)* $($three)* $($chain)* }
        }

        impl Function {
            /// The rows that have a code.
            fn rows() -> Vec<(&'static Row, Self)> {
                let families = [
                    $(($unary_section::$unary.row(<$unary_type as Bits>::BITS), Self::$unary),)*
                    $(($commuting_section::$commuting.row(<$commuting_type as Bits>::BITS), Self::$commuting),)*
                    $(($binary_section::$binary.row(<$binary_type as Bits>::BITS), Self::$binary),)*
                    $(($ternary_section::$ternary.row(<$ternary_type as Bits>::BITS), Self::$ternary),)*
                ];
                let conversions = [$((
                    conversion::row(Conversion::$conversion, <$from as Bits>::BITS, <$into as Bits>::BITS),
                    Self::$conversion,
                )),*];
                let truncation = (conversion::row(Conversion::FToS, 32, 32), Self::FToS);
                let all = families.into_iter().chain(conversions).chain([truncation]);
                all.filter_map(|(row, function)| Some((row?, function))).collect()
            }

            /// Whether the first two operands may change places.
            fn commutes(self) -> bool {
                matches!(self, $(Self::$commuting)|* | Self::TwoProducts | Self::ThreeProducts)
            }

            /// Pairs: both functions, how they hang together, and the function that is both.
            const PAIRS: &'static [(Self, Self, Shape, Self)] = &[
                $((Self::$two_first, Self::$two_second, Shape::$two_shape, Self::$two),)*
                $((Self::$three_first, Self::$three_second, Shape::$three_shape, Self::$three),)*
                $((Self::$chain_first, Self::$chain_second, Shape::$chain_shape, Self::$chain),)*
            ];
        }

        /// Runs steps; how many before one that ends the stretch.
        #[inline(always)]
        fn run_steps<const W: usize, R: Rows<W> + ?Sized, V: Vectors>(
            vectors: V,
            rows: &mut R,
            steps: &[Step],
            running: Option<&Lanes<W>>,
        ) -> usize {
            let mut accumulator = [0; W];
            let acc = &mut accumulator;
            let mut rest = steps.iter();
            while let Some(step) = rest.next() {
                match step.code {
                    codes::Move::ROWS => apply::<W, One<Same>, 0, false>(acc, rows, step),
                    codes::Move::FIRST => {}
                    codes::Move::ROWS_STORED => apply::<W, One<Same>, 0, true>(acc, rows, step),
                    codes::Move::FIRST_STORED => apply::<W, One<Same>, 1, true>(acc, rows, step),
                    codes::MoveMasked::ROWS_STORED => store::<W, 0>(acc, rows, step, running),
                    codes::MoveMasked::FIRST_STORED => store::<W, 1>(acc, rows, step, running),
                    codes::SettleMasked::FIRST_STORED => {
                        apply::<W, One<Settled>, 1, false>(acc, rows, step);
                        store::<W, 1>(acc, rows, step, running);
                    }
                    codes::FToS::ROWS => to_integers::<W, V, 0, false>(vectors, acc, rows, step),
                    codes::FToS::ROWS_STORED => to_integers::<W, V, 0, true>(vectors, acc, rows, step),
                    codes::FToS::FIRST => to_integers::<W, V, 1, false>(vectors, acc, rows, step),
                    codes::FToS::FIRST_STORED => to_integers::<W, V, 1, true>(vectors, acc, rows, step),
                    codes::Settle::FIRST => apply::<W, One<Settled>, 1, false>(acc, rows, step),
                    codes::Settle::FIRST_STORED => apply::<W, One<Settled>, 1, true>(acc, rows, step),
                    $(
                    codes::$unary::ROWS => apply::<W, One<$unary_section::$unary<$unary_type>>, 0, false>(acc, rows, step),
                    codes::$unary::ROWS_STORED => apply::<W, One<$unary_section::$unary<$unary_type>>, 0, true>(acc, rows, step),
                    codes::$unary::FIRST => apply::<W, One<$unary_section::$unary<$unary_type>>, 1, false>(acc, rows, step),
                    codes::$unary::FIRST_STORED => apply::<W, One<$unary_section::$unary<$unary_type>>, 1, true>(acc, rows, step),
                    )*
                    $(
                    codes::$conversion::ROWS => apply::<W, One<Between<$from, $into>>, 0, false>(acc, rows, step),
                    codes::$conversion::ROWS_STORED => apply::<W, One<Between<$from, $into>>, 0, true>(acc, rows, step),
                    codes::$conversion::FIRST => apply::<W, One<Between<$from, $into>>, 1, false>(acc, rows, step),
                    codes::$conversion::FIRST_STORED => apply::<W, One<Between<$from, $into>>, 1, true>(acc, rows, step),
                    )*
                    $(
                    codes::$commuting::ROWS => apply::<W, Two<$commuting_section::$commuting<$commuting_type>>, 0, false>(acc, rows, step),
                    codes::$commuting::ROWS_STORED => apply::<W, Two<$commuting_section::$commuting<$commuting_type>>, 0, true>(acc, rows, step),
                    codes::$commuting::FIRST => apply::<W, Two<$commuting_section::$commuting<$commuting_type>>, 1, false>(acc, rows, step),
                    codes::$commuting::FIRST_STORED => apply::<W, Two<$commuting_section::$commuting<$commuting_type>>, 1, true>(acc, rows, step),
                    )*
                    $(
                    codes::$binary::ROWS => apply::<W, Two<$binary_section::$binary<$binary_type>>, 0, false>(acc, rows, step),
                    codes::$binary::ROWS_STORED => apply::<W, Two<$binary_section::$binary<$binary_type>>, 0, true>(acc, rows, step),
                    codes::$binary::FIRST => apply::<W, Two<$binary_section::$binary<$binary_type>>, 1, false>(acc, rows, step),
                    codes::$binary::FIRST_STORED => apply::<W, Two<$binary_section::$binary<$binary_type>>, 1, true>(acc, rows, step),
                    codes::$binary::SECOND => apply::<W, Two<$binary_section::$binary<$binary_type>>, 2, false>(acc, rows, step),
                    codes::$binary::SECOND_STORED => apply::<W, Two<$binary_section::$binary<$binary_type>>, 2, true>(acc, rows, step),
                    )*
                    $(
                    codes::$two::ROWS => apply::<W, Two<$two_type>, 0, false>(acc, rows, step),
                    codes::$two::ROWS_STORED => apply::<W, Two<$two_type>, 0, true>(acc, rows, step),
                    codes::$two::FIRST => apply::<W, Two<$two_type>, 1, false>(acc, rows, step),
                    codes::$two::FIRST_STORED => apply::<W, Two<$two_type>, 1, true>(acc, rows, step),
                    codes::$two::SECOND => apply::<W, Two<$two_type>, 2, false>(acc, rows, step),
                    codes::$two::SECOND_STORED => apply::<W, Two<$two_type>, 2, true>(acc, rows, step),
                    )*
                    $(
                    codes::$ternary::ROWS => apply::<W, Three<$ternary_section::$ternary<$ternary_type>>, 0, false>(acc, rows, step),
                    codes::$ternary::ROWS_STORED => apply::<W, Three<$ternary_section::$ternary<$ternary_type>>, 0, true>(acc, rows, step),
                    codes::$ternary::FIRST => apply::<W, Three<$ternary_section::$ternary<$ternary_type>>, 1, false>(acc, rows, step),
                    codes::$ternary::FIRST_STORED => apply::<W, Three<$ternary_section::$ternary<$ternary_type>>, 1, true>(acc, rows, step),
                    codes::$ternary::SECOND => apply::<W, Three<$ternary_section::$ternary<$ternary_type>>, 2, false>(acc, rows, step),
                    codes::$ternary::SECOND_STORED => apply::<W, Three<$ternary_section::$ternary<$ternary_type>>, 2, true>(acc, rows, step),
                    codes::$ternary::THIRD => apply::<W, Three<$ternary_section::$ternary<$ternary_type>>, 3, false>(acc, rows, step),
                    codes::$ternary::THIRD_STORED => apply::<W, Three<$ternary_section::$ternary<$ternary_type>>, 3, true>(acc, rows, step),
                    )*
                    $(
                    codes::$three::ROWS => apply::<W, Three<$three_type>, 0, false>(acc, rows, step),
                    codes::$three::ROWS_STORED => apply::<W, Three<$three_type>, 0, true>(acc, rows, step),
                    codes::$three::FIRST => apply::<W, Three<$three_type>, 1, false>(acc, rows, step),
                    codes::$three::FIRST_STORED => apply::<W, Three<$three_type>, 1, true>(acc, rows, step),
                    codes::$three::SECOND => apply::<W, Three<$three_type>, 2, false>(acc, rows, step),
                    codes::$three::SECOND_STORED => apply::<W, Three<$three_type>, 2, true>(acc, rows, step),
                    codes::$three::THIRD => apply::<W, Three<$three_type>, 3, false>(acc, rows, step),
                    codes::$three::THIRD_STORED => apply::<W, Three<$three_type>, 3, true>(acc, rows, step),
                    )*
                    $(
                    codes::$chain::ROWS => apply::<W, $chain_type, 0, false>(acc, rows, step),
                    codes::$chain::ROWS_STORED => apply::<W, $chain_type, 0, true>(acc, rows, step),
                    codes::$chain::FIRST => apply::<W, $chain_type, 1, false>(acc, rows, step),
                    codes::$chain::FIRST_STORED => apply::<W, $chain_type, 1, true>(acc, rows, step),
                    )*
                    _ => return steps.len() - rest.len() - 1,
                }
            }
            steps.len()
        }
    };
    (@codes $($name:ident)*) => {$(
        #[allow(dead_code)]
        pub mod $name {
            use super::super::{Function, code};
            pub const ROWS: u16 = code(Function::$name, 0, false);
            pub const ROWS_STORED: u16 = code(Function::$name, 0, true);
            pub const FIRST: u16 = code(Function::$name, 1, false);
            pub const FIRST_STORED: u16 = code(Function::$name, 1, true);
            pub const SECOND: u16 = code(Function::$name, 2, false);
            pub const SECOND_STORED: u16 = code(Function::$name, 2, true);
            pub const THIRD: u16 = code(Function::$name, 3, false);
            pub const THIRD_STORED: u16 = code(Function::$name, 3, true);
        }
    )*};
}

type FMul = arithmetic::FMul<f32>;
type FAdd = arithmetic::FAdd<f32>;
type FSub = arithmetic::FSub<f32>;
type IMul = arithmetic::IMul<u32>;
type IAdd = arithmetic::IAdd<u32>;
type Right = bit::ShiftRightLogical<u32>;
/// A shift to the right whose result is taken for a signed number.
struct SignedRight;

impl Binary for SignedRight {
    type A = u32;
    type B = u32;
    type R = i32;
    #[inline(always)]
    fn apply(a: u32, b: u32) -> i32 {
        Right::apply(a, b) as i32
    }
}

type Left = bit::ShiftLeftLogical<u32>;
type Xor = bit::BitwiseXor<u32>;
type And = bit::BitwiseAnd<u32>;
type Or = bit::BitwiseOr<u32>;

type ShiftXor = WithItself<Right, Xor>;
/// Two rounds by which hashes mix bits.
type MixTwice = Chain<Three<Then<ShiftXor, IMul>>, Three<Then<ShiftXor, IMul>>>;
/// A third round ends with its exclusive or.
type Mix = Chain<MixTwice, Two<ShiftXor>>;
/// Of inner products, and of matrices and vectors.
type TwoProducts = Last<Two<FMul>, Three<Then<FMul, FAdd>>>;

functions! {
    unary {
    SNegate arithmetic i32, FNegate arithmetic f32, Not bit u32, LogicalNot logical bool, IsNan logical f32,
    IsInf logical f32, FAbs glsl f32, SAbs glsl i32, Trunc glsl f32, Floor glsl f32, Ceil glsl f32,
    Fract glsl f32, RoundEven glsl f32, Sqrt glsl f32,
    }
    commuting {
    IAdd arithmetic u32, IMul arithmetic u32, FAdd arithmetic f32, FMul arithmetic f32,
    BitwiseOr bit u32, BitwiseXor bit u32, BitwiseAnd bit u32,
    LogicalEqual logical bool, LogicalNotEqual logical bool, LogicalOr logical bool, LogicalAnd logical bool,
    IEqual logical u32, INotEqual logical u32, FOrdEqual logical f32, FOrdNotEqual logical f32,
    FUnordNotEqual logical f32, UMin glsl u32, SMin glsl i32, UMax glsl u32, SMax glsl i32,
    }
    binary {
    ISub arithmetic u32, FSub arithmetic f32, FDiv arithmetic f32,
    ShiftRightLogical bit u32, ShiftRightArithmetic bit i32, ShiftLeftLogical bit u32,
    UGreaterThan logical u32, SGreaterThan logical i32, UGreaterThanEqual logical u32,
    SGreaterThanEqual logical i32, ULessThan logical u32, SLessThan logical i32, ULessThanEqual logical u32,
    SLessThanEqual logical i32, FOrdLessThan logical f32, FOrdGreaterThan logical f32,
    FOrdLessThanEqual logical f32, FOrdGreaterThanEqual logical f32, FUnordLessThan logical f32,
    FUnordGreaterThan logical f32, FUnordLessThanEqual logical f32, FUnordGreaterThanEqual logical f32,
    FMin glsl f32, FMax glsl f32, NMin glsl f32, NMax glsl f32, Step glsl f32,
    }
    ternary {
    SelectWord select bool, FMix glsl f32, Fma glsl f32,
    }
    conversions {
    SToF i32 f32, UToF u32 f32,
    }
    two {
    ShiftXor WithItself ShiftRightLogical BitwiseXor ShiftXor;
    ShiftLeftXor WithItself ShiftLeftLogical BitwiseXor WithItself<Left, Xor>;
    SignedTimes ThenWith SToF FMul ThenWith<Between<i32, f32>, FMul>;
    }
    three {
    ShiftXorTimes Then ShiftXor IMul Then<ShiftXor, IMul>;
    ShiftTimes Then ShiftRightLogical SignedTimes Then<SignedRight, ThenWith<Between<i32, f32>, FMul>>;
    MulAdd Then FMul FAdd Then<FMul, FAdd>;
    MulSub Then FMul FSub Then<FMul, FSub>;
    SubMul After FMul FSub After<FMul, FSub>;
    MulMul Then FMul FMul Then<FMul, FMul>;
    AddTimes Then FAdd FMul Then<FAdd, FMul>;
    SubTimes Then FSub FMul Then<FSub, FMul>;
    AddAdd Then FAdd FAdd Then<FAdd, FAdd>;
    SubAdd Then FSub FAdd Then<FSub, FAdd>;
    ShiftAnd Then ShiftRightLogical BitwiseAnd Then<Right, And>;
    ShiftOr Then ShiftRightLogical BitwiseOr Then<Right, Or>;
    ShiftLeftOr Then ShiftLeftLogical BitwiseOr Then<Left, Or>;
    XorTimes Then BitwiseXor IMul Then<Xor, IMul>;
    TimesPlus Then IMul IAdd Then<IMul, IAdd>;
    PlusPlus Then IAdd IAdd Then<IAdd, IAdd>;
    PlusTimes Then IAdd IMul Then<IAdd, IMul>;
    }
    chains {
    MixTwice Chain ShiftXorTimes ShiftXorTimes MixTwice;
    Mix Chain MixTwice ShiftXor Mix;
    SubMulTimes Chain SubMul FMul Chain<Three<After<FMul, FSub>>, Two<FMul>>;
    TwoProducts Last FMul MulAdd TwoProducts;
    ThreeProducts Last TwoProducts MulAdd Last<TwoProducts, Three<Then<FMul, FAdd>>>;
    }
}

impl Steps {
    /// Runs operations until one that ends a stretch, or all of them, with what the processor has; the
    /// operation to go on with.
    #[inline]
    pub fn run<const W: usize>(
        &self,
        registers: &mut Registers<W>,
        ops: &[Op],
        range: Range<u32>,
        mask: Mask<W>,
    ) -> u32
    where
        Row: Width<W>,
    {
        let [mut first, end] = [range.start, range.end].map(|op| self.first[op as usize] as usize);
        let running = (!mask.is_all()).then(|| mask.words());
        loop {
            let steps = &self.steps[first..end];
            first += self.run_some(registers, steps, running.as_ref());
            let Some(&op) = self.ops[..end].get(first) else { return range.end };
            // Rows without a code.
            let Op::Row { row, to, from } = &ops[op as usize] else { return op };
            row.run(registers, *to, from);
            first += 1;
        }
    }

    /// Runs steps; how many before one that ends the stretch.
    fn run_some<const W: usize>(
        &self,
        registers: &mut Registers<W>,
        steps: &[Step],
        running: Option<&Lanes<W>>,
    ) -> usize {
        let processor = registers.processor();
        let rows = registers.all_mut();
        match if self.wide { None } else { rows.first_chunk_mut::<WINDOW>() } {
            Some(rows) => processor.run_widest(Loop { rows, steps, running }),
            None => processor.run_widest(Loop { rows, steps, running }),
        }
    }
}

/// The loop with its arguments.
struct Loop<'a, const W: usize, R: ?Sized> {
    rows: &'a mut R,
    steps: &'a [Step],
    running: Option<&'a Lanes<W>>,
}

impl<const W: usize, R: Rows<W> + ?Sized> Task for Loop<'_, W, R> {
    type Output = usize;

    #[inline(always)]
    fn run<V: Vectors>(self, vectors: V) -> usize {
        run_steps(vectors, self.rows, self.steps, self.running)
    }
}

#[cfg(test)]
mod tests;
