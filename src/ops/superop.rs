//! Superinstructions: frequent operations on 32-bit values, run without leaving one loop.
//!
//! Most operations of a shader are some ninety regular instructions on 32-bit values, and moves. A
//! [`SuperOp`] names one of them by an opcode. Its loop over the lanes is one arm of a `match` that
//! is compiled as a whole for the processor's vectors. The result of each superinstruction stays in
//! an *accumulator*, a register that the compiler keeps in vector registers from one
//! superinstruction to the next: an operand that the one before it computed is not loaded, and a
//! result without other uses is never stored. Frequent pairs and chains of operations have an
//! opcode of their own, because dispatch takes time, too. Each of their operations is rounded
//! separately; none is fused.
//!
//! Lane kernels write every NaN as the canonical one ([`crate::machine::Scalar::to_words`]). Here
//! that is a superinstruction of its own, `CanonicalizeNan`. It is emitted only after results whose
//! NaN payload may be observed: an operation on floats treats all NaNs alike.
//!
//! Operands that are constants are often uniform: read as one word for all lanes. Such opcodes keep
//! the word in a vector register, where the register would be loaded vector by vector. A batch has
//! its constants in all lanes from the beginning, and no operation writes their registers, so it
//! does not matter which lanes are active.
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
use words::{
    BinaryWord, CanonicalNan, Chain, Identity, Last, OnBothOperands, TernaryWord, UnaryWord, WordFunction,
};

/// One superinstruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SuperOp {
    /// The function, which operand the accumulator is, and whether the result goes to its register,
    /// too.
    opcode: u16,
    to: u8,
    from: Operands<u8>,
}

/// The operands of a superinstruction: one operation has up to three, chains have more. With an
/// array of eight, the compiler loads the register numbers as one vector and splits it, which takes
/// longer.
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

/// Applies a function to registers and puts the result into the accumulator. Operand `ACC_OPERAND`,
/// counted from one, is the accumulator's old value (0 for none); if `STORED`, the result is stored
/// in its register, too. Operands whose bit is set in `UNIFORM` are the same in all lanes: one word
/// is read of each, and kept in a vector register. Those whose bit is set in `SHIFT_AMOUNTS` are
/// shift amounts less than 32.
#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[inline(always)]
fn apply<
    const W: usize,
    F: WordFunction,
    const ACC_OPERAND: usize,
    const STORED: bool,
    const UNIFORM: u8,
    const SHIFT_AMOUNTS: u8,
>(
    accumulator: &mut [u32; W],
    registers: &mut DirectRegisters<W>,
    superop: &SuperOp,
) {
    // Written out: closures would be compiled anew for each of the many instances of this function.
    let held = Lanes(*accumulator);
    let [a, b, c, d, e, f] = [
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 0) } {
            &registers[usize::from(superop.from[0])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 1) } {
            &registers[usize::from(superop.from[1])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 2) } {
            &registers[usize::from(superop.from[2])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 3) } {
            &registers[usize::from(superop.from[3])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 4) } {
            &registers[usize::from(superop.from[4])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 5) } {
            &registers[usize::from(superop.from[5])]
        } else {
            &held
        },
    ];
    let words = [
        if const { has_operand(UNIFORM, 0) } { uniform(registers, superop, 0, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 1) } { uniform(registers, superop, 1, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 2) } { uniform(registers, superop, 2, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 3) } { uniform(registers, superop, 3, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 4) } { uniform(registers, superop, 4, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 5) } { uniform(registers, superop, 5, SHIFT_AMOUNTS) } else { 0 },
    ];
    let mut result = [0; W];
    for lane in 0..W {
        result[lane] = F::apply([
            if const { has_operand(UNIFORM, 0) } { words[0] } else { a.0[lane] },
            if const { has_operand(UNIFORM, 1) } { words[1] } else { b.0[lane] },
            if const { has_operand(UNIFORM, 2) } { words[2] } else { c.0[lane] },
            if const { has_operand(UNIFORM, 3) } { words[3] } else { d.0[lane] },
            if const { has_operand(UNIFORM, 4) } { words[4] } else { e.0[lane] },
            if const { has_operand(UNIFORM, 5) } { words[5] } else { f.0[lane] },
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
    at < F::OPERANDS && at + 1 != accumulator && !has_operand(uniform, at)
}

/// The word of a uniform operand.
#[inline(always)]
fn uniform<const W: usize>(
    registers: &DirectRegisters<W>,
    superop: &SuperOp,
    at: usize,
    shift_amounts: u8,
) -> u32 {
    // The mask lets the compiler leave out a comparison with 32.
    registers[usize::from(superop.from[at])].0[0] & if has_operand(shift_amounts, at) { 31 } else { !0 }
}

/// Whether the bit of an operand is set in a mask of operands.
const fn has_operand(uniform: u8, operand: usize) -> bool {
    uniform >> operand & 1 == 1
}

/// Does what [`apply`] does for the conversion of floats to integers: the compiler does not emit
/// the processor's conversion of eight lanes for a loop.
#[inline(always)]
fn to_integers<const W: usize, V: LaneOps, const ACC_OPERAND: usize, const STORED: bool>(
    vectors: V,
    accumulator: &mut [u32; W],
    registers: &mut DirectRegisters<W>,
    superop: &SuperOp,
) {
    const { assert!(W.is_multiple_of(8)) }
    let held = *accumulator;
    let floats = if ACC_OPERAND == 0 { &registers[usize::from(superop.from[0])].0 } else { &held };
    let mut result = [0; W];
    for (eight, to) in floats.as_chunks::<8>().0.iter().zip(result.as_chunks_mut::<8>().0) {
        *to = vectors.to_i32(vectors.load(&eight.map(f32::from_bits))).map(|integer| integer as u32);
    }
    if STORED {
        registers[usize::from(superop.to)].0 = result;
    }
    *accumulator = result;
}

/// Stores the accumulator, or a register; if not every lane is active, only in the lanes whose word
/// in `running` is all ones.
#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[inline(always)]
fn store<const W: usize, const ACC_OPERAND: usize>(
    accumulator: &mut [u32; W],
    registers: &mut DirectRegisters<W>,
    superop: &SuperOp,
    running: Option<&Lanes<W>>,
) {
    if ACC_OPERAND == 0 {
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

/// Encodes an opcode: the function, whether some operands are uniform ([`Function::uniform`]), the
/// operand that is the accumulator (counted from one; 0 for none), and whether the result is
/// stored.
const fn opcode(function: Function, uniform: bool, acc_operand: usize, stored: bool) -> u16 {
    (function as u16) << 4 | (uniform as u16) << 3 | (acc_operand as u16) << 1 | stored as u16
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
        binary_pairs { $($binary_pair:ident $binary_pair_shift_amounts:literal $binary_pair_shape:ident $binary_pair_first:ident $binary_pair_second:ident $binary_pair_type:ty;)* }
        ternary_pairs { $($ternary_pair:ident $ternary_pair_uniform:literal $ternary_pair_shift_amounts:literal $ternary_pair_shape:ident $ternary_pair_first:ident $ternary_pair_second:ident $ternary_pair_type:ty;)* }
        chains { $($chain:ident $chain_uniform:literal $chain_shift_amounts:literal $chain_shape:ident $chain_first:ident $chain_second:ident $chain_type:ty;)* }
    ) => {
        /// The function that a superinstruction computes.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        enum Function {
            Move,
            MoveMasked,
            CanonicalizeNan,
            /// `CanonicalizeNan`, then `MoveMasked`.
            CanonicalizeNanMasked,
            FToS,
            /// A float times itself.
            Square,
            $($unary,)* $($commuting,)* $($binary,)* $($shift,)* $($ternary,)* $($conversion,)* $($binary_pair,)* $($ternary_pair,)* $($chain,)*
            /// An operation that is no superinstruction: leaves the loop. It is the last variant,
            /// so that the numbers of the others begin with 0.
            Other,
        }

        /// Opcodes by the names of their functions, as patterns.
        #[allow(non_snake_case)]
        mod codes {
            functions! { @codes Move MoveMasked CanonicalizeNan CanonicalizeNanMasked FToS Square
                $($unary)* $($commuting)* $($binary)* $($shift)* $($ternary)* $($conversion)* $($binary_pair)* $($ternary_pair)* $($chain)* }
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
                let missing = "bug in anyhit: a superinstruction's function has no kernel of its width";
                all.map(|(kernel, function)| (kernel.expect(missing), function)).collect()
            }

            /// Whether the first two operands may be swapped.
            fn commutes(self) -> bool {
                matches!(self, $(Self::$commuting)|* | Self::DotProduct2 | Self::DotProduct3)
            }

            /// The operands that an opcode of its own reads as one word for all lanes, if all of
            /// them are constants: a bit for each, the first is the lowest. 0 if there is no such
            /// opcode.
            const fn uniform(self) -> u8 {
                match self {
                    $(Self::$commuting)|* | $(Self::$binary)|* | $(Self::$shift)|* | $(Self::$binary_pair)|* => SECOND,
                    $(Self::$ternary_pair => $ternary_pair_uniform,)*
                    $(Self::$chain => $chain_uniform,)*
                    _ => 0,
                }
            }

            /// The uniform operands that are shift amounts: a bit for each.
            const fn shift_amounts(self) -> u8 {
                match self {
                    $(Self::$shift)|* => SECOND,
                    $(Self::$binary_pair => $binary_pair_shift_amounts,)*
                    $(Self::$ternary_pair => $ternary_pair_shift_amounts,)*
                    $(Self::$chain => $chain_shift_amounts,)*
                    _ => 0,
                }
            }

            /// Pairs: both functions, how the second uses the first, and the function that is both.
            const PAIRS: &'static [(Self, Self, PairShape, Self)] = &[
                $((Self::$binary_pair_first, Self::$binary_pair_second, PairShape::$binary_pair_shape, Self::$binary_pair),)*
                $((Self::$ternary_pair_first, Self::$ternary_pair_second, PairShape::$ternary_pair_shape, Self::$ternary_pair),)*
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
                    codes::Move::NO_ACC => apply::<W, UnaryWord<Identity>, 0, false, 0, 0>(acc, registers, superop),
                    codes::Move::ACC_FIRST => {}
                    codes::Move::NO_ACC_STORED => apply::<W, UnaryWord<Identity>, 0, true, 0, 0>(acc, registers, superop),
                    codes::Move::ACC_FIRST_STORED => apply::<W, UnaryWord<Identity>, 1, true, 0, 0>(acc, registers, superop),
                    codes::MoveMasked::NO_ACC_STORED => store::<W, 0>(acc, registers, superop, running),
                    codes::MoveMasked::ACC_FIRST_STORED => store::<W, 1>(acc, registers, superop, running),
                    codes::CanonicalizeNanMasked::ACC_FIRST_STORED => {
                        apply::<W, UnaryWord<CanonicalNan>, 1, false, 0, 0>(acc, registers, superop);
                        store::<W, 1>(acc, registers, superop, running);
                    }
                    codes::FToS::NO_ACC => to_integers::<W, V, 0, false>(vectors, acc, registers, superop),
                    codes::FToS::NO_ACC_STORED => to_integers::<W, V, 0, true>(vectors, acc, registers, superop),
                    codes::FToS::ACC_FIRST => to_integers::<W, V, 1, false>(vectors, acc, registers, superop),
                    codes::FToS::ACC_FIRST_STORED => to_integers::<W, V, 1, true>(vectors, acc, registers, superop),
                    codes::Square::ACC_FIRST => apply::<W, UnaryWord<OnBothOperands<FMul>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::Square::ACC_FIRST_STORED => apply::<W, UnaryWord<OnBothOperands<FMul>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::CanonicalizeNan::ACC_FIRST => apply::<W, UnaryWord<CanonicalNan>, 1, false, 0, 0>(acc, registers, superop),
                    codes::CanonicalizeNan::ACC_FIRST_STORED => apply::<W, UnaryWord<CanonicalNan>, 1, true, 0, 0>(acc, registers, superop),
                    $(
                    codes::$unary::NO_ACC => apply::<W, UnaryWord<$unary_section::$unary<$unary_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$unary::NO_ACC_STORED => apply::<W, UnaryWord<$unary_section::$unary<$unary_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$unary::ACC_FIRST => apply::<W, UnaryWord<$unary_section::$unary<$unary_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$unary::ACC_FIRST_STORED => apply::<W, UnaryWord<$unary_section::$unary<$unary_type>>, 1, true, 0, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$conversion::NO_ACC => apply::<W, UnaryWord<Between<$from, $into>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$conversion::NO_ACC_STORED => apply::<W, UnaryWord<Between<$from, $into>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$conversion::ACC_FIRST => apply::<W, UnaryWord<Between<$from, $into>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$conversion::ACC_FIRST_STORED => apply::<W, UnaryWord<Between<$from, $into>>, 1, true, 0, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$commuting::NO_ACC => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$commuting::NO_ACC_STORED => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$commuting::ACC_FIRST => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$commuting::ACC_FIRST_STORED => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$commuting::UNIFORM_NO_ACC => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 0, false, SECOND, 0>(acc, registers, superop),
                    codes::$commuting::UNIFORM_NO_ACC_STORED => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 0, true, SECOND, 0>(acc, registers, superop),
                    codes::$commuting::UNIFORM_ACC_FIRST => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 1, false, SECOND, 0>(acc, registers, superop),
                    codes::$commuting::UNIFORM_ACC_FIRST_STORED => apply::<W, BinaryWord<$commuting_section::$commuting<$commuting_type>>, 1, true, SECOND, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$binary::NO_ACC => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$binary::NO_ACC_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$binary::ACC_FIRST => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$binary::ACC_FIRST_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$binary::ACC_SECOND => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$binary::ACC_SECOND_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$binary::UNIFORM_NO_ACC => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 0, false, SECOND, 0>(acc, registers, superop),
                    codes::$binary::UNIFORM_NO_ACC_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 0, true, SECOND, 0>(acc, registers, superop),
                    codes::$binary::UNIFORM_ACC_FIRST => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 1, false, SECOND, 0>(acc, registers, superop),
                    codes::$binary::UNIFORM_ACC_FIRST_STORED => apply::<W, BinaryWord<$binary_section::$binary<$binary_type>>, 1, true, SECOND, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$shift::NO_ACC => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$shift::NO_ACC_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$shift::ACC_FIRST => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$shift::ACC_FIRST_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$shift::ACC_SECOND => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$shift::ACC_SECOND_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$shift::UNIFORM_NO_ACC => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 0, false, SECOND, SECOND>(acc, registers, superop),
                    codes::$shift::UNIFORM_NO_ACC_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 0, true, SECOND, SECOND>(acc, registers, superop),
                    codes::$shift::UNIFORM_ACC_FIRST => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 1, false, SECOND, SECOND>(acc, registers, superop),
                    codes::$shift::UNIFORM_ACC_FIRST_STORED => apply::<W, BinaryWord<$shift_section::$shift<$shift_type>>, 1, true, SECOND, SECOND>(acc, registers, superop),
                    )*
                    $(
                    codes::$binary_pair::NO_ACC => apply::<W, BinaryWord<$binary_pair_type>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$binary_pair::NO_ACC_STORED => apply::<W, BinaryWord<$binary_pair_type>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$binary_pair::ACC_FIRST => apply::<W, BinaryWord<$binary_pair_type>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$binary_pair::ACC_FIRST_STORED => apply::<W, BinaryWord<$binary_pair_type>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$binary_pair::ACC_SECOND => apply::<W, BinaryWord<$binary_pair_type>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$binary_pair::ACC_SECOND_STORED => apply::<W, BinaryWord<$binary_pair_type>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$binary_pair::UNIFORM_NO_ACC => apply::<W, BinaryWord<$binary_pair_type>, 0, false, SECOND, $binary_pair_shift_amounts>(acc, registers, superop),
                    codes::$binary_pair::UNIFORM_NO_ACC_STORED => apply::<W, BinaryWord<$binary_pair_type>, 0, true, SECOND, $binary_pair_shift_amounts>(acc, registers, superop),
                    codes::$binary_pair::UNIFORM_ACC_FIRST => apply::<W, BinaryWord<$binary_pair_type>, 1, false, SECOND, $binary_pair_shift_amounts>(acc, registers, superop),
                    codes::$binary_pair::UNIFORM_ACC_FIRST_STORED => apply::<W, BinaryWord<$binary_pair_type>, 1, true, SECOND, $binary_pair_shift_amounts>(acc, registers, superop),
                    )*
                    $(
                    codes::$ternary::NO_ACC => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$ternary::NO_ACC_STORED => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$ternary::ACC_FIRST => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$ternary::ACC_FIRST_STORED => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$ternary::ACC_SECOND => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$ternary::ACC_SECOND_STORED => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$ternary::ACC_THIRD => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 3, false, 0, 0>(acc, registers, superop),
                    codes::$ternary::ACC_THIRD_STORED => apply::<W, TernaryWord<$ternary_section::$ternary<$ternary_type>>, 3, true, 0, 0>(acc, registers, superop),
                    )*
                    $(
                    codes::$ternary_pair::NO_ACC => apply::<W, TernaryWord<$ternary_pair_type>, 0, false, 0, 0>(acc, registers, superop),
                    codes::$ternary_pair::NO_ACC_STORED => apply::<W, TernaryWord<$ternary_pair_type>, 0, true, 0, 0>(acc, registers, superop),
                    codes::$ternary_pair::ACC_FIRST => apply::<W, TernaryWord<$ternary_pair_type>, 1, false, 0, 0>(acc, registers, superop),
                    codes::$ternary_pair::ACC_FIRST_STORED => apply::<W, TernaryWord<$ternary_pair_type>, 1, true, 0, 0>(acc, registers, superop),
                    codes::$ternary_pair::ACC_SECOND => apply::<W, TernaryWord<$ternary_pair_type>, 2, false, 0, 0>(acc, registers, superop),
                    codes::$ternary_pair::ACC_SECOND_STORED => apply::<W, TernaryWord<$ternary_pair_type>, 2, true, 0, 0>(acc, registers, superop),
                    codes::$ternary_pair::ACC_THIRD => apply::<W, TernaryWord<$ternary_pair_type>, 3, false, 0, 0>(acc, registers, superop),
                    codes::$ternary_pair::ACC_THIRD_STORED => apply::<W, TernaryWord<$ternary_pair_type>, 3, true, 0, 0>(acc, registers, superop),
                    codes::$ternary_pair::UNIFORM_NO_ACC => apply::<W, TernaryWord<$ternary_pair_type>, 0, false, $ternary_pair_uniform, $ternary_pair_shift_amounts>(acc, registers, superop),
                    codes::$ternary_pair::UNIFORM_NO_ACC_STORED => apply::<W, TernaryWord<$ternary_pair_type>, 0, true, $ternary_pair_uniform, $ternary_pair_shift_amounts>(acc, registers, superop),
                    codes::$ternary_pair::UNIFORM_ACC_FIRST => apply::<W, TernaryWord<$ternary_pair_type>, 1, false, $ternary_pair_uniform, $ternary_pair_shift_amounts>(acc, registers, superop),
                    codes::$ternary_pair::UNIFORM_ACC_FIRST_STORED => apply::<W, TernaryWord<$ternary_pair_type>, 1, true, $ternary_pair_uniform, $ternary_pair_shift_amounts>(acc, registers, superop),
                    )*
                    $(
                    codes::$chain::NO_ACC => apply::<W, $chain_type, 0, false, 0, 0>(acc, registers, superop),
                    codes::$chain::NO_ACC_STORED => apply::<W, $chain_type, 0, true, 0, 0>(acc, registers, superop),
                    codes::$chain::ACC_FIRST => apply::<W, $chain_type, 1, false, 0, 0>(acc, registers, superop),
                    codes::$chain::ACC_FIRST_STORED => apply::<W, $chain_type, 1, true, 0, 0>(acc, registers, superop),
                    codes::$chain::UNIFORM_NO_ACC => apply::<W, $chain_type, 0, false, $chain_uniform, $chain_shift_amounts>(acc, registers, superop),
                    codes::$chain::UNIFORM_NO_ACC_STORED => apply::<W, $chain_type, 0, true, $chain_uniform, $chain_shift_amounts>(acc, registers, superop),
                    codes::$chain::UNIFORM_ACC_FIRST => apply::<W, $chain_type, 1, false, $chain_uniform, $chain_shift_amounts>(acc, registers, superop),
                    codes::$chain::UNIFORM_ACC_FIRST_STORED => apply::<W, $chain_type, 1, true, $chain_uniform, $chain_shift_amounts>(acc, registers, superop),
                    )*
                    _ => return superops.len() - rest.len() - 1,
                }
            }
            superops.len()
        }
    };
    (@codes $($name:ident)*) => {$(
        #[allow(dead_code)]
        pub(super) mod $name {
            use super::super::{Function, opcode};
            pub(in crate::ops::superop) const NO_ACC: u16 = opcode(Function::$name, false, 0, false);
            pub(in crate::ops::superop) const NO_ACC_STORED: u16 = opcode(Function::$name, false, 0, true);
            pub(in crate::ops::superop) const ACC_FIRST: u16 = opcode(Function::$name, false, 1, false);
            pub(in crate::ops::superop) const ACC_FIRST_STORED: u16 = opcode(Function::$name, false, 1, true);
            pub(in crate::ops::superop) const ACC_SECOND: u16 = opcode(Function::$name, false, 2, false);
            pub(in crate::ops::superop) const ACC_SECOND_STORED: u16 = opcode(Function::$name, false, 2, true);
            pub(in crate::ops::superop) const ACC_THIRD: u16 = opcode(Function::$name, false, 3, false);
            pub(in crate::ops::superop) const ACC_THIRD_STORED: u16 = opcode(Function::$name, false, 3, true);
            pub(in crate::ops::superop) const UNIFORM_NO_ACC: u16 = opcode(Function::$name, true, 0, false);
            pub(in crate::ops::superop) const UNIFORM_NO_ACC_STORED: u16 = opcode(Function::$name, true, 0, true);
            pub(in crate::ops::superop) const UNIFORM_ACC_FIRST: u16 = opcode(Function::$name, true, 1, false);
            pub(in crate::ops::superop) const UNIFORM_ACC_FIRST_STORED: u16 = opcode(Function::$name, true, 1, true);
        }
    )*};
}

type FMul = arithmetic::FMul<f32>;
type FAdd = arithmetic::FAdd<f32>;
type FSub = arithmetic::FSub<f32>;
type IMul = arithmetic::IMul<u32>;
type IAdd = arithmetic::IAdd<u32>;
type ShiftRight = bit::ShiftRightLogical<u32>;
/// A logical shift right whose result is a signed number.
struct SignedShiftRight;

impl Binary for SignedShiftRight {
    type A = u32;
    type B = u32;
    type R = i32;
    #[inline(always)]
    fn apply(a: u32, b: u32) -> i32 {
        ShiftRight::apply(a, b) as i32
    }
}

type ShiftLeft = bit::ShiftLeftLogical<u32>;
type Xor = bit::BitwiseXor<u32>;
type And = bit::BitwiseAnd<u32>;
type Or = bit::BitwiseOr<u32>;

type ShiftXor = WithItself<ShiftRight, Xor>;
/// Two rounds of a hash's bit mixing: shift, exclusive or, multiplication.
type MixTwice = Chain<TernaryWord<Then<ShiftXor, IMul>>, TernaryWord<Then<ShiftXor, IMul>>>;
/// [`MixTwice`] and the shift and exclusive or of a third round.
type Mix = Chain<MixTwice, BinaryWord<ShiftXor>>;
/// `a * b + c * d`: a dot product of two components, as in products of matrices and vectors.
type DotProduct2 = Last<BinaryWord<FMul>, TernaryWord<Then<FMul, FAdd>>>;

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
    binary_pairs {
    ShiftXor 0b10 WithItself ShiftRightLogical BitwiseXor ShiftXor;
    ShiftLeftXor 0b10 WithItself ShiftLeftLogical BitwiseXor WithItself<ShiftLeft, Xor>;
    SToFMul 0 ThenWith SToF FMul ThenWith<Between<i32, f32>, FMul>;
    }
    ternary_pairs {
    ShiftXorIMul 0b110 0b010 Then ShiftXor IMul Then<ShiftXor, IMul>;
    ShiftSToFMul 0b110 0b010 Then ShiftRightLogical SToFMul Then<SignedShiftRight, ThenWith<Between<i32, f32>, FMul>>;
    MulAdd 0b010 0 Then FMul FAdd Then<FMul, FAdd>;
    MulSub 0b010 0 Then FMul FSub Then<FMul, FSub>;
    NegMulAdd 0b110 0 After FMul FSub After<FMul, FSub>;
    MulMul 0b010 0 Then FMul FMul Then<FMul, FMul>;
    AddMul 0b110 0 Then FAdd FMul Then<FAdd, FMul>;
    SubMul 0b100 0 Then FSub FMul Then<FSub, FMul>;
    AddAdd 0b110 0 Then FAdd FAdd Then<FAdd, FAdd>;
    SubAdd 0b110 0 Then FSub FAdd Then<FSub, FAdd>;
    ShiftAnd 0b110 0b010 Then ShiftRightLogical BitwiseAnd Then<ShiftRight, And>;
    ShiftOr 0b010 0b010 Then ShiftRightLogical BitwiseOr Then<ShiftRight, Or>;
    ShiftLeftOr 0b010 0b010 Then ShiftLeftLogical BitwiseOr Then<ShiftLeft, Or>;
    XorIMul 0b100 0 Then BitwiseXor IMul Then<Xor, IMul>;
    IMulIAdd 0b010 0 Then IMul IAdd Then<IMul, IAdd>;
    IAddIAdd 0b110 0 Then IAdd IAdd Then<IAdd, IAdd>;
    IAddIMul 0b110 0 Then IAdd IMul Then<IAdd, IMul>;
    }
    chains {
    MixTwice 0b11110 0b01010 Chain ShiftXorIMul ShiftXorIMul MixTwice;
    Mix 0b111110 0b101010 Chain MixTwice ShiftXor Mix;
    NegMulAddMul 0b0110 0 Chain NegMulAdd FMul Chain<TernaryWord<After<FMul, FSub>>, BinaryWord<FMul>>;
    DotProduct2 0b1010 0 Last FMul MulAdd DotProduct2;
    DotProduct3 0b101010 0 Last DotProduct2 MulAdd Last<DotProduct2, TernaryWord<Then<FMul, FAdd>>>;
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
            first += self.run_until_exit(registers, superops, running.as_ref());
            let Some(&op) = self.op_of[..end].get(first) else { return range.end };
            // A lane kernel that has no opcode is called as a function.
            let Op::LaneKernel { kernel, to, from } = &ops[op as usize] else { return op };
            kernel.run(registers, *to, from);
            first += 1;
        }
    }

    /// Runs superinstructions. Returns how many ran before one that leaves the loop.
    fn run_until_exit<const W: usize>(
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
