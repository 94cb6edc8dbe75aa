//! Superinstructions: frequent operations on 32-bit values, run without leaving one loop.
//!
//! Most operations of a shader are some ninety regular instructions on 32-bit values, and moves. A
//! [`SuperOp`] names one of them by an opcode. Its loop over the lanes is one arm of a `match` that
//! is compiled as a whole for the processor's vectors. The result of each superinstruction stays in
//! an *accumulator*, a register that the compiler keeps in vector registers from one
//! superinstruction to the next: an operand that the one before it computed is not loaded, and a
//! result without other uses is never stored. Frequent pairs and chains of operations have an
//! opcode of their own, because dispatch takes time, too. Each of their operations rounds as it
//! does by itself.
//!
//! Lane kernels write every NaN as the same bits ([`crate::machine::Scalar::to_words`]). Here that
//! is a superinstruction of its own, `Settle`. It is emitted only after results whose NaN payload
//! may be observed: an operation on floats treats all NaNs alike.
//!
//! Operands that are constants are often read as one word for all lanes. Such opcodes keep the word
//! in a vector register, where the register would be loaded vector by vector. A batch has its
//! constants in all lanes from the beginning, and no operation writes their registers, so it does
//! not matter which lanes run.
//!
//! `plan` selects superinstructions for operations. A lane kernel without an opcode is called as a
//! function, and so is one that reads or writes an extended register ([`DIRECT_REGISTERS`]); an
//! irregular operation leaves the loop. Only functions that need few vector registers
//! have an opcode: one arm that needs all sixteen makes the compiler spill the accumulator in every
//! arm.

mod pairs;
mod plan;
mod verify;
mod words;

use std::ops::Range;

use crate::machine::lanes::Lanes;
use crate::machine::{Mask, Registers};
use crate::math::lane_ops::{LaneOps, LaneTask};
use crate::ops::conversion::{self, Between, Conversion};
use crate::ops::lane_kernel::{Binary, LaneKernel, ScalarWidth, Width};
use crate::ops::op::Op;
use crate::ops::relational_logical::select;
use crate::ops::{arithmetic, bit, glsl, relational_logical as logical};
use pairs::{After, PairShape, Then, ThenWith, WithItself};
pub use plan::{ResultUse, takes_float};
use words::{BinaryWord, Chain, Last, Same, Settled, TernaryWord, UnaryWord, WithBoth, WordFunction};

/// One superinstruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SuperOp {
    /// The function, which operand the accumulator is, and whether the result goes to its register,
    /// too.
    opcode: u16,
    to: u8,
    from: Operands<u8>,
}

/// The operands of a superinstruction: one operation has up to three, chains have more. With eight
/// the compiler loads their numbers as one vector and splits it, which takes longer.
type Operands<T> = [T; 6];

/// The operations of a program as superinstructions.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SuperCode {
    superops: Vec<SuperOp>,
    /// The operation that each superinstruction comes from.
    op_of: Vec<u32>,
    /// The first superinstruction of each operation, and one more entry.
    first: Vec<u32>,
}

/// How many registers are direct: superinstructions name them by one byte, which needs no bounds
/// check. An operation on any of the others, the extended ones, becomes no superinstruction.
pub const DIRECT_REGISTERS: usize = 256;

/// The direct registers.
type DirectRegisters<const W: usize> = [Lanes<W>; DIRECT_REGISTERS];

/// Applies a function to registers and puts the result into the accumulator. Operand `AT`, counted
/// from one, is the accumulator's old value (0 for none); if `STORED`, the result goes to its
/// register, too. Operands whose bit is set in `UNIFORM` are the same in all lanes: one word is
/// read of each, and kept in a vector register. Those whose bit is set in `AMOUNTS` are shift
/// amounts less than 32.
#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[inline(always)]
fn apply<
    const W: usize,
    F: WordFunction,
    const AT: usize,
    const STORED: bool,
    const UNIFORM: u8,
    const AMOUNTS: u8,
>(
    accumulator: &mut [u32; W],
    registers: &mut DirectRegisters<W>,
    superop: &SuperOp,
) {
    // Written out: closures would be compiled anew for each of the many instances of this function.
    let held = Lanes(*accumulator);
    let [a, b, c, d, e, f] = [
        if const { reads::<F>(AT, UNIFORM, 0) } { &registers[usize::from(superop.from[0])] } else { &held },
        if const { reads::<F>(AT, UNIFORM, 1) } { &registers[usize::from(superop.from[1])] } else { &held },
        if const { reads::<F>(AT, UNIFORM, 2) } { &registers[usize::from(superop.from[2])] } else { &held },
        if const { reads::<F>(AT, UNIFORM, 3) } { &registers[usize::from(superop.from[3])] } else { &held },
        if const { reads::<F>(AT, UNIFORM, 4) } { &registers[usize::from(superop.from[4])] } else { &held },
        if const { reads::<F>(AT, UNIFORM, 5) } { &registers[usize::from(superop.from[5])] } else { &held },
    ];
    let words = [
        if const { has(UNIFORM, 0) } { uniform(registers, superop, 0, AMOUNTS) } else { 0 },
        if const { has(UNIFORM, 1) } { uniform(registers, superop, 1, AMOUNTS) } else { 0 },
        if const { has(UNIFORM, 2) } { uniform(registers, superop, 2, AMOUNTS) } else { 0 },
        if const { has(UNIFORM, 3) } { uniform(registers, superop, 3, AMOUNTS) } else { 0 },
        if const { has(UNIFORM, 4) } { uniform(registers, superop, 4, AMOUNTS) } else { 0 },
        if const { has(UNIFORM, 5) } { uniform(registers, superop, 5, AMOUNTS) } else { 0 },
    ];
    let mut result = [0; W];
    for lane in 0..W {
        result[lane] = F::apply([
            if const { has(UNIFORM, 0) } { words[0] } else { a.0[lane] },
            if const { has(UNIFORM, 1) } { words[1] } else { b.0[lane] },
            if const { has(UNIFORM, 2) } { words[2] } else { c.0[lane] },
            if const { has(UNIFORM, 3) } { words[3] } else { d.0[lane] },
            if const { has(UNIFORM, 4) } { words[4] } else { e.0[lane] },
            if const { has(UNIFORM, 5) } { words[5] } else { f.0[lane] },
        ]);
    }
    if STORED {
        registers[usize::from(superop.to)].0 = result;
    }
    *accumulator = result;
}

/// Whether an operand of a function is read lane by lane from its register: if the function has it,
/// and it is neither the accumulator nor uniform.
const fn reads<F: WordFunction>(accumulator: usize, uniform: u8, at: usize) -> bool {
    at < F::OPERANDS && at + 1 != accumulator && !has(uniform, at)
}

/// The word of a uniform operand.
#[inline(always)]
fn uniform<const W: usize>(registers: &DirectRegisters<W>, superop: &SuperOp, at: usize, amounts: u8) -> u32 {
    // The mask lets the compiler leave out a comparison with 32.
    registers[usize::from(superop.from[at])].0[0] & if has(amounts, at) { 31 } else { !0 }
}

/// Whether the bit of an operand is set in a mask of operands.
const fn has(uniform: u8, operand: usize) -> bool {
    uniform >> operand & 1 == 1
}

/// As [`apply`], for floats to integers: the compiler does not make the processor's conversion of
/// eight from a loop.
#[inline(always)]
fn to_integers<const W: usize, V: LaneOps, const AT: usize, const STORED: bool>(
    vectors: V,
    accumulator: &mut [u32; W],
    registers: &mut DirectRegisters<W>,
    superop: &SuperOp,
) {
    const { assert!(W.is_multiple_of(8)) }
    let held = *accumulator;
    let floats = if AT == 0 { &registers[usize::from(superop.from[0])].0 } else { &held };
    let mut result = [0; W];
    for (eight, to) in floats.as_chunks::<8>().0.iter().zip(result.as_chunks_mut::<8>().0) {
        *to = vectors.to_i32(vectors.load(&eight.map(f32::from_bits))).map(|integer| integer as u32);
    }
    if STORED {
        registers[usize::from(superop.to)].0 = result;
    }
    *accumulator = result;
}

/// Stores the accumulator, or a register; if not every lane runs, in those whose word in `running`
/// is all ones.
#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[inline(always)]
fn store<const W: usize, const AT: usize>(
    accumulator: &mut [u32; W],
    registers: &mut DirectRegisters<W>,
    superop: &SuperOp,
    running: Option<&Lanes<W>>,
) {
    if AT == 0 {
        *accumulator = registers[usize::from(superop.from[0])].0;
    }
    let to = &mut registers[usize::from(superop.to)];
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

/// The opcode of a function: whether some operands are read as one word for all lanes
/// ([`Function::uniform`]), the operand that is the accumulator, and whether the result is stored.
const fn opcode(function: Function, uniform: bool, at: usize, stored: bool) -> u16 {
    (function as u16) << 4 | (uniform as u16) << 3 | (at as u16) << 1 | stored as u16
}

/// The second operand's bit in [`Function::uniform`].
const SECOND: u8 = 0b10;

macro_rules! functions {
    (
        unary { $($unary:ident $unary_section:ident $unary_type:ident,)* }
        commuting { $($commuting:ident $commuting_section:ident $commuting_type:ident,)* }
        binary { $($binary:ident $binary_section:ident $binary_type:ident,)* }
        shifts { $($shift:ident $shift_section:ident $shift_type:ident,)* }
        ternary { $($ternary:ident $ternary_section:ident $ternary_type:ident,)* }
        conversions { $($conversion:ident $from:ident $into:ident,)* }
        two { $($two:ident $two_amounts:literal $two_shape:ident $two_first:ident $two_second:ident $two_type:ty;)* }
        three { $($three:ident $three_uniform:literal $three_amounts:literal $three_shape:ident $three_first:ident $three_second:ident $three_type:ty;)* }
        chains { $($chain:ident $chain_uniform:literal $chain_amounts:literal $chain_shape:ident $chain_first:ident $chain_second:ident $chain_type:ty;)* }
    ) => {
        /// The function that a superinstruction computes.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        enum Function {
            Move,
            MoveMasked,
            Settle,
            /// `Settle`, then `MoveMasked`.
            SettleMasked,
            FToS,
            /// A float times itself.
            Square,
            $($unary,)* $($commuting,)* $($binary,)* $($shift,)* $($ternary,)* $($conversion,)* $($two,)* $($three,)* $($chain,)*
            /// No superinstruction: leaves the loop. It is the last, so that the others begin with
            /// 0.
            Other,
        }

        /// Opcodes by the names of their functions, as patterns.
        #[allow(non_snake_case)]
        mod codes {
            functions! { @codes Move MoveMasked Settle SettleMasked FToS Square
                $($unary)* $($commuting)* $($binary)* $($shift)* $($ternary)* $($conversion)* $($two)* $($three)* $($chain)* }
        }

        impl Function {
            /// The lane kernels that have an opcode.
            fn kernels() -> Vec<(&'static LaneKernel, Self)> {
                let families = [
                    $(($unary_section::$unary.kernel(<$unary_type as ScalarWidth>::BITS), Self::$unary),)*
                    $(($commuting_section::$commuting.kernel(<$commuting_type as ScalarWidth>::BITS), Self::$commuting),)*
                    $(($binary_section::$binary.kernel(<$binary_type as ScalarWidth>::BITS), Self::$binary),)*
                    $(($shift_section::$shift.kernel(<$shift_type as ScalarWidth>::BITS), Self::$shift),)*
                    $(($ternary_section::$ternary.kernel(<$ternary_type as ScalarWidth>::BITS), Self::$ternary),)*
                ];
                let conversions = [$((
                    conversion::kernel(Conversion::$conversion, <$from as ScalarWidth>::BITS, <$into as ScalarWidth>::BITS),
                    Self::$conversion,
                )),*];
                let truncation = (conversion::kernel(Conversion::FToS, 32, 32), Self::FToS);
                let all = families.into_iter().chain(conversions).chain([truncation]);
                all.filter_map(|(kernel, function)| Some((kernel?, function))).collect()
            }

            /// Whether the first two operands may change places.
            fn commutes(self) -> bool {
                matches!(self, $(Self::$commuting)|* | Self::TwoProducts | Self::ThreeProducts)
            }

            /// The operands that an opcode of its own reads as one word for all lanes, if all of
            /// them are constants: a bit for each, the first is the lowest. 0 if there is no such
            /// opcode.
            const fn uniform(self) -> u8 {
                match self {
                    $(Self::$commuting)|* | $(Self::$binary)|* | $(Self::$shift)|* | $(Self::$two)|* => SECOND,
                    $(Self::$three => $three_uniform,)*
                    $(Self::$chain => $chain_uniform,)*
                    _ => 0,
                }
            }

            /// The uniform operands that are shift amounts: a bit for each.
            const fn amounts(self) -> u8 {
                match self {
                    $(Self::$shift)|* => SECOND,
                    $(Self::$two => $two_amounts,)*
                    $(Self::$three => $three_amounts,)*
                    $(Self::$chain => $chain_amounts,)*
                    _ => 0,
                }
            }

            /// Pairs: both functions, how the second uses the first, and the function that is both.
            const PAIRS: &'static [(Self, Self, PairShape, Self)] = &[
                $((Self::$two_first, Self::$two_second, PairShape::$two_shape, Self::$two),)*
                $((Self::$three_first, Self::$three_second, PairShape::$three_shape, Self::$three),)*
                $((Self::$chain_first, Self::$chain_second, PairShape::$chain_shape, Self::$chain),)*
            ];
        }

        /// Runs superinstructions. Returns how many ran before one that leaves the loop.
        #[inline(always)]
        fn run_superops<const W: usize, V: LaneOps>(
            vectors: V,
            registers: &mut DirectRegisters<W>,
            superops: &[SuperOp],
            running: Option<&Lanes<W>>,
        ) -> usize {
            let mut accumulator = [0; W];
            let acc = &mut accumulator;
            let mut rest = superops.iter();
            while let Some(superop) = rest.next() {
                match superop.opcode {
                    codes::Move::REGISTERS => apply::<W, UnaryWord<Same>, 0, false, 0, 0>(acc, registers, superop),
                    codes::Move::FIRST => {}
                    codes::Move::REGISTERS_STORED => apply::<W, UnaryWord<Same>, 0, true, 0, 0>(acc, registers, superop),
                    codes::Move::FIRST_STORED => apply::<W, UnaryWord<Same>, 1, true, 0, 0>(acc, registers, superop),
                    codes::MoveMasked::REGISTERS_STORED => store::<W, 0>(acc, registers, superop, running),
                    codes::MoveMasked::FIRST_STORED => store::<W, 1>(acc, registers, superop, running),
                    codes::SettleMasked::FIRST_STORED => {
                        apply::<W, UnaryWord<Settled>, 1, false, 0, 0>(acc, registers, superop);
                        store::<W, 1>(acc, registers, superop, running);
                    }
                    codes::FToS::REGISTERS => to_integers::<W, V, 0, false>(vectors, acc, registers, superop),
                    codes::FToS::REGISTERS_STORED => to_integers::<W, V, 0, true>(vectors, acc, registers, superop),
                    codes::FToS::FIRST => to_integers::<W, V, 1, false>(vectors, acc, registers, superop),
                    codes::FToS::FIRST_STORED => to_integers::<W, V, 1, true>(vectors, acc, registers, superop),
                    codes::Square::FIRST => apply::<W, UnaryWord<WithBoth<FMul>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::Square::FIRST_STORED => apply::<W, UnaryWord<WithBoth<FMul>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::Settle::FIRST => apply::<W, UnaryWord<Settled>, 1, false, 0, 0>(acc, registers, superop),
                    codes::Settle::FIRST_STORED => apply::<W, UnaryWord<Settled>, 1, true, 0, 0>(acc, registers, superop),
                    $(
                    codes::$unary::REGISTERS => apply::<W, UnaryWord<$unary_section::$unary<$unary_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$unary::REGISTERS_STORED => apply::<W, UnaryWord<$unary_section::$unary<$unary_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$unary::FIRST => apply::<W, UnaryWord<$unary_section::$unary<$unary_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$unary::FIRST_STORED => apply::<W, UnaryWord<$unary_section::$unary<$unary_type>>, 1, true, 0, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$conversion::REGISTERS => apply::<W, UnaryWord<Between<$from, $into>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$conversion::REGISTERS_STORED => apply::<W, UnaryWord<Between<$from, $into>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$conversion::FIRST => apply::<W, UnaryWord<Between<$from, $into>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$conversion::FIRST_STORED => apply::<W, UnaryWord<Between<$from, $into>>, 1, true, 0, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$commuting::REGISTERS => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$commuting::REGISTERS_STORED => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$commuting::FIRST => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$commuting::FIRST_STORED => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$commuting::UNIFORM_REGISTERS => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 0, false, SECOND, 0>(acc, registers, superop),
                    codes::$commuting::UNIFORM_REGISTERS_STORED => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 0, true, SECOND, 0>(acc, registers, superop),
                    codes::$commuting::UNIFORM_FIRST => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 1, false, SECOND, 0>(acc, registers, superop),
                    codes::$commuting::UNIFORM_FIRST_STORED => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 1, true, SECOND, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$binary::REGISTERS => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$binary::REGISTERS_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$binary::FIRST => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$binary::FIRST_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$binary::SECOND => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$binary::SECOND_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$binary::UNIFORM_REGISTERS => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 0, false, SECOND, 0>(acc, registers, superop),
                    codes::$binary::UNIFORM_REGISTERS_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 0, true, SECOND, 0>(acc, registers, superop),
                    codes::$binary::UNIFORM_FIRST => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 1, false, SECOND, 0>(acc, registers, superop),
                    codes::$binary::UNIFORM_FIRST_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 1, true, SECOND, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$shift::REGISTERS => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$shift::REGISTERS_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$shift::FIRST => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$shift::FIRST_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$shift::SECOND => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$shift::SECOND_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$shift::UNIFORM_REGISTERS => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 0, false, SECOND, SECOND>(acc, registers, superop),
                    codes::$shift::UNIFORM_REGISTERS_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 0, true, SECOND, SECOND>(acc, registers, superop),
                    codes::$shift::UNIFORM_FIRST => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 1, false, SECOND, SECOND>(acc, registers, superop),
                    codes::$shift::UNIFORM_FIRST_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 1, true, SECOND, SECOND>(acc, registers, superop),
                    )*
                    $(
                    codes::$two::REGISTERS => apply::<W, BinaryWord<$two_type>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$two::REGISTERS_STORED => apply::<W, BinaryWord<$two_type>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$two::FIRST => apply::<W, BinaryWord<$two_type>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$two::FIRST_STORED => apply::<W, BinaryWord<$two_type>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$two::SECOND => apply::<W, BinaryWord<$two_type>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$two::SECOND_STORED => apply::<W, BinaryWord<$two_type>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$two::UNIFORM_REGISTERS => apply::<W, BinaryWord<$two_type>, 0, false, SECOND, $two_amounts>(acc, registers, superop),
                    codes::$two::UNIFORM_REGISTERS_STORED => apply::<W, BinaryWord<$two_type>, 0, true, SECOND, $two_amounts>(acc, registers, superop),
                    codes::$two::UNIFORM_FIRST => apply::<W, BinaryWord<$two_type>, 1, false, SECOND, $two_amounts>(acc, registers, superop),
                    codes::$two::UNIFORM_FIRST_STORED => apply::<W, BinaryWord<$two_type>, 1, true, SECOND, $two_amounts>(acc, registers, superop),
                    )*
                    $(
                    codes::$ternary::REGISTERS => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$ternary::REGISTERS_STORED => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$ternary::FIRST => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$ternary::FIRST_STORED => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$ternary::SECOND => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$ternary::SECOND_STORED => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$ternary::THIRD => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 3, false, 0, 0>(acc, registers, superop),
                    codes::$ternary::THIRD_STORED => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 3, true, 0, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$three::REGISTERS => apply::<W, TernaryWord<$three_type>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$three::REGISTERS_STORED => apply::<W, TernaryWord<$three_type>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$three::FIRST => apply::<W, TernaryWord<$three_type>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$three::FIRST_STORED => apply::<W, TernaryWord<$three_type>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$three::SECOND => apply::<W, TernaryWord<$three_type>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$three::SECOND_STORED => apply::<W, TernaryWord<$three_type>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$three::THIRD => apply::<W, TernaryWord<$three_type>, 3, false, 0, 0>(acc, registers, superop),
                    codes::$three::THIRD_STORED => apply::<W, TernaryWord<$three_type>, 3, true, 0, 0>(acc, registers, superop),
                    codes::$three::UNIFORM_REGISTERS => apply::<W, TernaryWord<$three_type>, 0, false, $three_uniform, $three_amounts>(acc, registers, superop),
                    codes::$three::UNIFORM_REGISTERS_STORED => apply::<W, TernaryWord<$three_type>, 0, true, $three_uniform, $three_amounts>(acc, registers, superop),
                    codes::$three::UNIFORM_FIRST => apply::<W, TernaryWord<$three_type>, 1, false, $three_uniform, $three_amounts>(acc, registers, superop),
                    codes::$three::UNIFORM_FIRST_STORED => apply::<W, TernaryWord<$three_type>, 1, true, $three_uniform, $three_amounts>(acc, registers, superop),
                    )*
                    $(
                    codes::$chain::REGISTERS => apply::<W, $chain_type, 0, false, 0, 0>(acc, registers, superop),
                    codes::$chain::REGISTERS_STORED => apply::<W, $chain_type, 0, true, 0, 0>(acc, registers, superop),
                    codes::$chain::FIRST => apply::<W, $chain_type, 1, false, 0, 0>(acc, registers, superop),
                    codes::$chain::FIRST_STORED => apply::<W, $chain_type, 1, true, 0, 0>(acc, registers, superop),
                    codes::$chain::UNIFORM_REGISTERS => apply::<W, $chain_type, 0, false, $chain_uniform, $chain_amounts>(acc, registers, superop),
                    codes::$chain::UNIFORM_REGISTERS_STORED => apply::<W, $chain_type, 0, true, $chain_uniform, $chain_amounts>(acc, registers, superop),
                    codes::$chain::UNIFORM_FIRST => apply::<W, $chain_type, 1, false, $chain_uniform, $chain_amounts>(acc, registers, superop),
                    codes::$chain::UNIFORM_FIRST_STORED => apply::<W, $chain_type, 1, true, $chain_uniform, $chain_amounts>(acc, registers, superop),
                    )*
                    _ => return superops.len() - rest.len() - 1,
                }
            }
            superops.len()
        }
    };
    (@codes $($name:ident)*) => {$(
        #[allow(dead_code)]
        pub mod $name {
            use super::super::{Function, opcode};
            pub const REGISTERS: u16 = opcode(Function::$name, false, 0, false);
            pub const REGISTERS_STORED: u16 = opcode(Function::$name, false, 0, true);
            pub const FIRST: u16 = opcode(Function::$name, false, 1, false);
            pub const FIRST_STORED: u16 = opcode(Function::$name, false, 1, true);
            pub const SECOND: u16 = opcode(Function::$name, false, 2, false);
            pub const SECOND_STORED: u16 = opcode(Function::$name, false, 2, true);
            pub const THIRD: u16 = opcode(Function::$name, false, 3, false);
            pub const THIRD_STORED: u16 = opcode(Function::$name, false, 3, true);
            pub const UNIFORM_REGISTERS: u16 = opcode(Function::$name, true, 0, false);
            pub const UNIFORM_REGISTERS_STORED: u16 = opcode(Function::$name, true, 0, true);
            pub const UNIFORM_FIRST: u16 = opcode(Function::$name, true, 1, false);
            pub const UNIFORM_FIRST_STORED: u16 = opcode(Function::$name, true, 1, true);
        }
    )*};
}

type FMul = arithmetic::FMul<f32>;
type FAdd = arithmetic::FAdd<f32>;
type FSub = arithmetic::FSub<f32>;
type IMul = arithmetic::IMul<u32>;
type IAdd = arithmetic::IAdd<u32>;
type Right = bit::ShiftRightLogical<u32>;
/// A logical shift to the right whose result is a signed number.
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
type MixTwice = Chain<TernaryWord<Then<ShiftXor, IMul>>, TernaryWord<Then<ShiftXor, IMul>>>;
/// A third round ends with its exclusive or.
type Mix = Chain<MixTwice, BinaryWord<ShiftXor>>;
/// Found in inner products, and in products of matrices and vectors.
type TwoProducts = Last<BinaryWord<FMul>, TernaryWord<Then<FMul, FAdd>>>;

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
    UGreaterThan logical u32, SGreaterThan logical i32, UGreaterThanEqual logical u32,
    SGreaterThanEqual logical i32, ULessThan logical u32, SLessThan logical i32, ULessThanEqual logical u32,
    SLessThanEqual logical i32, FOrdLessThan logical f32, FOrdGreaterThan logical f32,
    FOrdLessThanEqual logical f32, FOrdGreaterThanEqual logical f32, FUnordLessThan logical f32,
    FUnordGreaterThan logical f32, FUnordLessThanEqual logical f32, FUnordGreaterThanEqual logical f32,
    FMin glsl f32, FMax glsl f32, NMin glsl f32, NMax glsl f32, Step glsl f32,
    }
    shifts {
    ShiftRightLogical bit u32, ShiftRightArithmetic bit i32, ShiftLeftLogical bit u32,
    }
    ternary {
    SelectWord select bool, FMix glsl f32, Fma glsl f32,
    }
    conversions {
    SToF i32 f32, UToF u32 f32,
    }
    two {
    ShiftXor 0b10 WithItself ShiftRightLogical BitwiseXor ShiftXor;
    ShiftLeftXor 0b10 WithItself ShiftLeftLogical BitwiseXor WithItself<Left, Xor>;
    SignedTimes 0 ThenWith SToF FMul ThenWith<Between<i32, f32>, FMul>;
    }
    three {
    ShiftXorTimes 0b110 0b010 Then ShiftXor IMul Then<ShiftXor, IMul>;
    ShiftTimes 0b110 0b010 Then ShiftRightLogical SignedTimes Then<SignedRight, ThenWith<Between<i32, f32>, FMul>>;
    MulAdd 0b010 0 Then FMul FAdd Then<FMul, FAdd>;
    MulSub 0b010 0 Then FMul FSub Then<FMul, FSub>;
    SubMul 0b110 0 After FMul FSub After<FMul, FSub>;
    MulMul 0b010 0 Then FMul FMul Then<FMul, FMul>;
    AddTimes 0b110 0 Then FAdd FMul Then<FAdd, FMul>;
    SubTimes 0b100 0 Then FSub FMul Then<FSub, FMul>;
    AddAdd 0b110 0 Then FAdd FAdd Then<FAdd, FAdd>;
    SubAdd 0b110 0 Then FSub FAdd Then<FSub, FAdd>;
    ShiftAnd 0b110 0b010 Then ShiftRightLogical BitwiseAnd Then<Right, And>;
    ShiftOr 0b010 0b010 Then ShiftRightLogical BitwiseOr Then<Right, Or>;
    ShiftLeftOr 0b010 0b010 Then ShiftLeftLogical BitwiseOr Then<Left, Or>;
    XorTimes 0b100 0 Then BitwiseXor IMul Then<Xor, IMul>;
    TimesPlus 0b010 0 Then IMul IAdd Then<IMul, IAdd>;
    PlusPlus 0b110 0 Then IAdd IAdd Then<IAdd, IAdd>;
    PlusTimes 0b110 0 Then IAdd IMul Then<IAdd, IMul>;
    }
    chains {
    MixTwice 0b11110 0b01010 Chain ShiftXorTimes ShiftXorTimes MixTwice;
    Mix 0b111110 0b101010 Chain MixTwice ShiftXor Mix;
    SubMulTimes 0b0110 0 Chain SubMul FMul Chain<TernaryWord<After<FMul, FSub>>, BinaryWord<FMul>>;
    TwoProducts 0b1010 0 Last FMul MulAdd TwoProducts;
    ThreeProducts 0b101010 0 Last TwoProducts MulAdd Last<TwoProducts, TernaryWord<Then<FMul, FAdd>>>;
    }
}

impl SuperCode {
    /// Runs a range of operations up to one that is no superinstruction and no lane kernel. Returns
    /// that operation, or the end of the range.
    #[inline]
    pub fn run<const W: usize>(
        &self,
        registers: &mut Registers<W>,
        ops: &[Op],
        range: Range<u32>,
        mask: Mask<W>,
    ) -> u32
    where
        LaneKernel: Width<W>,
    {
        let [mut first, end] = [range.start, range.end].map(|op| self.first[op as usize] as usize);
        let running = (!mask.is_all()).then(|| mask.words());
        loop {
            let superops = &self.superops[first..end];
            first += self.run_some(registers, superops, running.as_ref());
            let Some(&op) = self.op_of[..end].get(first) else { return range.end };
            // A lane kernel without a superinstruction.
            let Op::LaneKernel { kernel, to, from } = &ops[op as usize] else { return op };
            kernel.run(registers, *to, from);
            first += 1;
        }
    }

    /// Runs superinstructions. Returns how many ran before one that leaves the loop.
    fn run_some<const W: usize>(
        &self,
        registers: &mut Registers<W>,
        superops: &[SuperOp],
        running: Option<&Lanes<W>>,
    ) -> usize {
        let cpu_tier = registers.cpu_tier();
        let registers = registers.all_mut().first_chunk_mut().expect("every batch has the direct registers");
        let ran = cpu_tier.run_wide(Loop { registers, superops, running });
        ran.expect("superinstructions run on a CPU with wide registers")
    }
}

/// The interpreter loop with its arguments.
struct Loop<'a, const W: usize> {
    registers: &'a mut DirectRegisters<W>,
    superops: &'a [SuperOp],
    running: Option<&'a Lanes<W>>,
}

impl<const W: usize> LaneTask for Loop<'_, W> {
    type Output = usize;

    #[inline(always)]
    fn run<V: LaneOps>(self, vectors: V) -> usize {
        run_superops(vectors, self.registers, self.superops, self.running)
    }
}

#[cfg(test)]
mod tests;
