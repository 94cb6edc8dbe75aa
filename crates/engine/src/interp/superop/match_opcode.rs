//! The arms of the loop that the list of superinstructions stands for.

/// Executes one superinstruction: a `match` of its opcode, with the arms that the caller gives and
/// those for the functions of the list; what stands behind `else` is the arm of other opcodes.
/// Called through [`for_each_superop!`](crate::ops::superop::table::for_each_superop).
///
/// A function has two arms for each place of the accumulator among its operands, and two for calls
/// that do not read it: the second of the two also stores the result in a register. Where uniform
/// operands are read as such, only the first operand may be the accumulator.
macro_rules! match_opcode {
    // Which arms the functions of each group have, besides those of all.
    (
        { $arguments:tt $arms:tt else $exit:block }
        unary { $($unary:ident $_unary:tt,)* }
        commuting { $($commuting:ident $_commuting:tt,)* }
        binary { $($binary:ident $_binary:tt,)* }
        shifts { $($shift:ident $_shift:tt,)* }
        ternary { $($ternary:ident $_ternary:tt,)* }
        conversions { $($conversion:ident $_conversion:tt,)* }
        binary_pairs { $($binary_pair:ident $_binary_pair:tt,)* }
        ternary_pairs { $($ternary_pair:ident $_ternary_pair:tt,)* }
        chains { $($chain:ident $_chain:tt,)* }
    ) => {
        match_opcode! {
            $arguments $arms else $exit
            $({ $unary })*
            $({ $conversion })*
            $({ $commuting, uniform $commuting })*
            $({ $binary, second $binary, uniform $binary })*
            $({ $shift, second $shift, uniform $shift })*
            $({ $binary_pair, second $binary_pair, uniform $binary_pair })*
            $({ $ternary, second $ternary, third $ternary })*
            $({ $ternary_pair, second $ternary_pair, third $ternary_pair, uniform $ternary_pair })*
            $({ $chain, uniform $chain })*
        }
    };
    (
        ($acc:ident, $registers:ident, $superop:ident) { $($arms:tt)* } else $exit:block
        $({ $first:ident $(, second $second:ident)? $(, third $third:ident)? $(, uniform $uniform:ident)? })*
    ) => {
        match $superop.opcode {
            $($arms)*
            $(
            opcodes::$first::NO_ACC => apply::<V, functions::$first, 0, false, 0, 0>($acc, $registers, $superop),
            opcodes::$first::NO_ACC_STORED => apply::<V, functions::$first, 0, true, 0, 0>($acc, $registers, $superop),
            opcodes::$first::ACC_FIRST => apply::<V, functions::$first, 1, false, 0, 0>($acc, $registers, $superop),
            opcodes::$first::ACC_FIRST_STORED => apply::<V, functions::$first, 1, true, 0, 0>($acc, $registers, $superop),
            $(
            opcodes::$second::ACC_SECOND => apply::<V, functions::$second, 2, false, 0, 0>($acc, $registers, $superop),
            opcodes::$second::ACC_SECOND_STORED => apply::<V, functions::$second, 2, true, 0, 0>($acc, $registers, $superop),
            )?
            $(
            opcodes::$third::ACC_THIRD => apply::<V, functions::$third, 3, false, 0, 0>($acc, $registers, $superop),
            opcodes::$third::ACC_THIRD_STORED => apply::<V, functions::$third, 3, true, 0, 0>($acc, $registers, $superop),
            )?
            $(
            opcodes::$uniform::UNIFORM_NO_ACC => apply::<
                V, functions::$uniform, 0, false, { Function::$uniform.uniform() }, { Function::$uniform.shift_amounts() },
            >($acc, $registers, $superop),
            opcodes::$uniform::UNIFORM_NO_ACC_STORED => apply::<
                V, functions::$uniform, 0, true, { Function::$uniform.uniform() }, { Function::$uniform.shift_amounts() },
            >($acc, $registers, $superop),
            opcodes::$uniform::UNIFORM_ACC_FIRST => apply::<
                V, functions::$uniform, 1, false, { Function::$uniform.uniform() }, { Function::$uniform.shift_amounts() },
            >($acc, $registers, $superop),
            opcodes::$uniform::UNIFORM_ACC_FIRST_STORED => apply::<
                V, functions::$uniform, 1, true, { Function::$uniform.uniform() }, { Function::$uniform.shift_amounts() },
            >($acc, $registers, $superop),
            )?
            )*
            _ => $exit
        }
    };
}
pub(super) use match_opcode;
