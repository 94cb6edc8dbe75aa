//! The functions of superinstructions and their opcodes.

use crate::ops::conversion::{self, Conversion};
use crate::ops::lane_kernel::{LaneKernel, OpFamily, ScalarWidth};
use crate::ops::relational_logical::select;
use crate::ops::superop::table::for_each_superop;
use crate::ops::{arithmetic, bit, glsl, relational_logical};

/// How the functions of a pair are composed, where the result of the first is an operand of the
/// second and has no other use. Each function is rounded separately.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PairShape {
    /// `f = F(a, b)`, then `G(f, c)`.
    Then,
    /// `f = F(a, b)`, then `G(c, f)`.
    After,
    /// `f = F(a)`, then `G(f, b)`.
    ThenWith,
    /// `f = F(a, b)`, then `G(a, f)`.
    WithItself,
    /// `F`, then `G` with the result as its first operand: each of any number of operands.
    Chain,
    /// `F`, then `G` with the result as its last operand; the other operands of `G` follow those of
    /// `F`.
    Last,
}

/// Two functions, how the second uses the first, and the function that is both.
pub(crate) type Pair = (Function, Function, PairShape, Function);

/// The second operand's bit in [`Function::uniform`].
const SECOND: u8 = 0b10;

/// Writes what there is for each function of the list.
macro_rules! define_functions {
    (
        {}
        unary { $($unary:ident($unary_section:ident, $unary_type:ident),)* }
        commuting { $($commuting:ident($commuting_section:ident, $commuting_type:ident),)* }
        binary { $($binary:ident($binary_section:ident, $binary_type:ident),)* }
        shifts { $($shift:ident($shift_section:ident, $shift_type:ident),)* }
        ternary { $($ternary:ident($ternary_section:ident, $ternary_type:ident),)* }
        conversions { $($conversion:ident($from:ident, $into:ident),)* }
        $($pairs:ident {
            $($pair:ident(
                $shape:ident, $first:ident, $second:ident, uniform $uniform:literal, shift_amounts $amounts:literal
            ),)*
        })*
    ) => {
        /// The function that a superinstruction computes.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub(crate) enum Function {
            /// Returns its operand unchanged.
            Move,
            /// `Move`, whose result is stored in the active lanes alone.
            MoveMasked,
            /// Replaces a NaN with the canonical one that registers hold.
            CanonicalizeNan,
            /// `CanonicalizeNan`, then `MoveMasked`.
            CanonicalizeNanMasked,
            /// The integer that a float of 32 bits is truncated to.
            FToS,
            /// A float times itself.
            Square,
            $($unary,)* $($commuting,)* $($binary,)* $($shift,)* $($ternary,)* $($conversion,)* $($($pair,)*)*
            /// An operation that is no superinstruction: leaves the loop. It is the last variant,
            /// so that the numbers of the others begin with 0.
            Other,
        }

        /// Opcodes by the names of their functions, as patterns.
        pub(crate) mod opcodes {
            use super::{Function, Opcodes};

            define_functions! { @opcodes Move MoveMasked CanonicalizeNan CanonicalizeNanMasked FToS Square
                $($unary)* $($commuting)* $($binary)* $($shift)* $($ternary)* $($conversion)* $($($pair)*)* }
        }

        /// Families of lane kernels, the width of the kernel that has an opcode, and its function.
        static FAMILIES: &[(&OpFamily, u32, Function)] = &[
            $((&$unary_section::$unary, <$unary_type as ScalarWidth>::BITS, Function::$unary),)*
            $((&$commuting_section::$commuting, <$commuting_type as ScalarWidth>::BITS, Function::$commuting),)*
            $((&$binary_section::$binary, <$binary_type as ScalarWidth>::BITS, Function::$binary),)*
            $((&$shift_section::$shift, <$shift_type as ScalarWidth>::BITS, Function::$shift),)*
            $((&$ternary_section::$ternary, <$ternary_type as ScalarWidth>::BITS, Function::$ternary),)*
        ];

        /// Conversions with an opcode, the widths of operand and result, and their functions.
        static CONVERSIONS: &[(Conversion, u32, u32, Function)] = &[
            $((Conversion::$conversion, <$from as ScalarWidth>::BITS, <$into as ScalarWidth>::BITS, Function::$conversion),)*
            (Conversion::FToS, 32, 32, Function::FToS),
        ];

        impl Function {
            /// All pairs.
            pub(crate) const PAIRS: &'static [Pair] =
                &[$($((Self::$first, Self::$second, PairShape::$shape, Self::$pair),)*)*];

            /// Whether the first two operands may be swapped.
            pub(super) fn commutes(self) -> bool {
                matches!(self, $(Self::$commuting)|* | Self::DotProduct2 | Self::DotProduct3)
            }

            /// The operands that an opcode of its own reads as one word for all lanes, if all of
            /// them are constants: a bit for each, the first is the lowest. 0 if there is no such
            /// opcode.
            pub(crate) const fn uniform(self) -> u8 {
                match self {
                    $(Self::$commuting)|* | $(Self::$binary)|* | $(Self::$shift)|* => SECOND,
                    $($(Self::$pair => $uniform,)*)*
                    _ => 0,
                }
            }

            /// The uniform operands that are shift amounts: a bit for each.
            pub(crate) const fn shift_amounts(self) -> u8 {
                match self {
                    $(Self::$shift)|* => SECOND,
                    $($(Self::$pair => $amounts,)*)*
                    _ => 0,
                }
            }
        }
    };
    (@opcodes $($name:ident)*) => {
        $(pub(crate) type $name = Opcodes<{ Function::$name as u16 }>;)*
    };
}

for_each_superop! { define_functions }

impl Function {
    /// The lane kernels that have an opcode.
    pub(crate) fn kernels() -> Vec<(&'static LaneKernel, Self)> {
        let families = FAMILIES.iter().map(|&(family, width, function)| (family.kernel(width), function));
        let conversions = CONVERSIONS
            .iter()
            .map(|&(kind, from, to, function)| (conversion::kernel(kind, from, to), function));
        let missing = "bug in anyhit: a superinstruction's function has no kernel of its width";
        families.chain(conversions).map(|(kernel, function)| (kernel.expect(missing), function)).collect()
    }
}

/// Encodes an opcode: the function, whether some operands are uniform ([`Function::uniform`]), the
/// operand that is the accumulator (counted from one; 0 for none), and whether the result is
/// stored.
pub(crate) const fn opcode(function: Function, uniform: bool, acc_operand: usize, stored: bool) -> u16 {
    encode(function as u16, uniform, acc_operand, stored)
}

/// Encodes an opcode of the function with a number.
const fn encode(function: u16, uniform: bool, acc_operand: usize, stored: bool) -> u16 {
    function << 4 | (uniform as u16) << 3 | (acc_operand as u16) << 1 | stored as u16
}

/// Whether the bit of an operand is set in a mask of operands.
#[inline(always)]
pub(crate) const fn has_operand(mask: u8, operand: usize) -> bool {
    mask >> operand & 1 == 1
}

/// The opcodes of the function with a number. Their names say which operand is the accumulator,
/// whether some operands are uniform, and whether the result is stored.
pub(crate) struct Opcodes<const FUNCTION: u16>;

impl<const FUNCTION: u16> Opcodes<FUNCTION> {
    pub(crate) const NO_ACC: u16 = encode(FUNCTION, false, 0, false);
    pub(crate) const NO_ACC_STORED: u16 = encode(FUNCTION, false, 0, true);
    pub(crate) const ACC_FIRST: u16 = encode(FUNCTION, false, 1, false);
    pub(crate) const ACC_FIRST_STORED: u16 = encode(FUNCTION, false, 1, true);
    pub(crate) const ACC_SECOND: u16 = encode(FUNCTION, false, 2, false);
    pub(crate) const ACC_SECOND_STORED: u16 = encode(FUNCTION, false, 2, true);
    pub(crate) const ACC_THIRD: u16 = encode(FUNCTION, false, 3, false);
    pub(crate) const ACC_THIRD_STORED: u16 = encode(FUNCTION, false, 3, true);
    pub(crate) const UNIFORM_NO_ACC: u16 = encode(FUNCTION, true, 0, false);
    pub(crate) const UNIFORM_NO_ACC_STORED: u16 = encode(FUNCTION, true, 0, true);
    pub(crate) const UNIFORM_ACC_FIRST: u16 = encode(FUNCTION, true, 1, false);
    pub(crate) const UNIFORM_ACC_FIRST_STORED: u16 = encode(FUNCTION, true, 1, true);
}
