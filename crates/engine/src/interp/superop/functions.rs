//! The functions of superinstructions as types, by the names that they have in the list.
//!
//! Those of pairs are made of their parts, as the list says.

use crate::interp::superop::words;
use crate::interp::superop::words::{
    After, BinaryWord, Chain, Last, OnBothOperands, TernaryWord, Then, ThenWith, UnaryWord, WithItself,
};
use crate::ops::conversion::Between;
use crate::ops::relational_logical::select;
use crate::ops::superop::table::for_each_superop;
use crate::ops::{arithmetic, bit, glsl, relational_logical};

/// Returns its operand unchanged.
pub(super) type Move = words::Identity;
/// Replaces a NaN with the canonical one.
pub(super) type CanonicalizeNan = words::CanonicalNan;
/// A float times itself.
pub(super) type Square = OnBothOperands<FMul>;

/// Names the type of each function of the list.
macro_rules! define_types {
    (
        {}
        unary { $($unary:ident($unary_section:ident, $unary_type:ident),)* }
        commuting { $($commuting:ident($commuting_section:ident, $commuting_type:ident),)* }
        binary { $($binary:ident($binary_section:ident, $binary_type:ident),)* }
        shifts { $($shift:ident($shift_section:ident, $shift_type:ident),)* }
        ternary { $($ternary:ident($ternary_section:ident, $ternary_type:ident),)* }
        conversions { $($conversion:ident($from:ident, $into:ident),)* }
        $($pairs:ident { $($pair:ident($shape:ident, $first:ident, $second:ident, $($masks:tt)*),)* })*
    ) => {
        $(pub(super) type $unary = UnaryWord<$unary_section::$unary<$unary_type>>;)*
        $(pub(super) type $commuting = BinaryWord<$commuting_section::$commuting<$commuting_type>>;)*
        $(pub(super) type $binary = BinaryWord<$binary_section::$binary<$binary_type>>;)*
        $(pub(super) type $shift = BinaryWord<$shift_section::$shift<$shift_type>>;)*
        $(pub(super) type $ternary = TernaryWord<$ternary_section::$ternary<$ternary_type>>;)*
        $(pub(super) type $conversion = UnaryWord<Between<$from, $into>>;)*
        $($(pub(super) type $pair = $shape<$first, $second>;)*)*
    };
}

for_each_superop! { define_types }
