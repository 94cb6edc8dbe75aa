//! The functions of superinstructions, as a list that other files make code of.

/// Calls a macro with arguments and the list of all functions: `callback! { {arguments} groups }`.
///
/// A function belongs to a group by the operands that it has, and by those that may come from the
/// accumulator or be the same in all lanes. What stands behind its name is
/// * for a lane kernel: the section of the instruction set, and the type of the operands;
/// * for a conversion: the types of operand and result;
/// * for a pair of functions: its [`PairShape`](crate::ops::superop::function::PairShape), both
///   functions, those of its operands that an opcode of its own takes as uniform, and which of
///   these are shift amounts: masks with a bit for each operand, of which the first is the lowest.
///
/// Opcodes are numbered in the order of the list.
macro_rules! for_each_superop {
    ($callback:ident $($arguments:tt)*) => {
        $callback! {
            { $($arguments)* }
            unary {
                SNegate(arithmetic, i32), FNegate(arithmetic, f32), Not(bit, u32),
                LogicalNot(relational_logical, bool), IsNan(relational_logical, f32),
                IsInf(relational_logical, f32), FAbs(glsl, f32), SAbs(glsl, i32), Trunc(glsl, f32),
                Floor(glsl, f32), Ceil(glsl, f32), Fract(glsl, f32), RoundEven(glsl, f32), Sqrt(glsl, f32),
            }
            commuting {
                IAdd(arithmetic, u32), IMul(arithmetic, u32), FAdd(arithmetic, f32), FMul(arithmetic, f32),
                BitwiseOr(bit, u32), BitwiseXor(bit, u32), BitwiseAnd(bit, u32),
                LogicalEqual(relational_logical, bool), LogicalNotEqual(relational_logical, bool),
                LogicalOr(relational_logical, bool), LogicalAnd(relational_logical, bool),
                IEqual(relational_logical, u32), INotEqual(relational_logical, u32),
                FOrdEqual(relational_logical, f32), FOrdNotEqual(relational_logical, f32),
                FUnordNotEqual(relational_logical, f32),
                UMin(glsl, u32), SMin(glsl, i32), UMax(glsl, u32), SMax(glsl, i32),
            }
            binary {
                ISub(arithmetic, u32), FSub(arithmetic, f32), FDiv(arithmetic, f32),
                UGreaterThan(relational_logical, u32), SGreaterThan(relational_logical, i32),
                UGreaterThanEqual(relational_logical, u32), SGreaterThanEqual(relational_logical, i32),
                ULessThan(relational_logical, u32), SLessThan(relational_logical, i32),
                ULessThanEqual(relational_logical, u32), SLessThanEqual(relational_logical, i32),
                FOrdLessThan(relational_logical, f32), FOrdGreaterThan(relational_logical, f32),
                FOrdLessThanEqual(relational_logical, f32), FOrdGreaterThanEqual(relational_logical, f32),
                FUnordLessThan(relational_logical, f32), FUnordGreaterThan(relational_logical, f32),
                FUnordLessThanEqual(relational_logical, f32), FUnordGreaterThanEqual(relational_logical, f32),
                FMin(glsl, f32), FMax(glsl, f32), NMin(glsl, f32), NMax(glsl, f32), Step(glsl, f32),
            }
            shifts {
                ShiftRightLogical(bit, u32), ShiftRightArithmetic(bit, i32), ShiftLeftLogical(bit, u32),
            }
            ternary {
                SelectWord(select, bool), FMix(glsl, f32), Fma(glsl, f32),
            }
            conversions {
                SToF(i32, f32), UToF(u32, f32),
            }
            binary_pairs {
                ShiftXor(WithItself, ShiftRightLogical, BitwiseXor, uniform 0b10, shift_amounts 0b10),
                ShiftLeftXor(WithItself, ShiftLeftLogical, BitwiseXor, uniform 0b10, shift_amounts 0b10),
                SToFMul(ThenWith, SToF, FMul, uniform 0b10, shift_amounts 0),
            }
            ternary_pairs {
                ShiftXorIMul(Then, ShiftXor, IMul, uniform 0b110, shift_amounts 0b010),
                ShiftSToFMul(Then, ShiftRightLogical, SToFMul, uniform 0b110, shift_amounts 0b010),
                MulAdd(Then, FMul, FAdd, uniform 0b010, shift_amounts 0),
                MulSub(Then, FMul, FSub, uniform 0b010, shift_amounts 0),
                NegMulAdd(After, FMul, FSub, uniform 0b110, shift_amounts 0),
                MulMul(Then, FMul, FMul, uniform 0b010, shift_amounts 0),
                AddMul(Then, FAdd, FMul, uniform 0b110, shift_amounts 0),
                SubMul(Then, FSub, FMul, uniform 0b100, shift_amounts 0),
                AddAdd(Then, FAdd, FAdd, uniform 0b110, shift_amounts 0),
                SubAdd(Then, FSub, FAdd, uniform 0b110, shift_amounts 0),
                ShiftAnd(Then, ShiftRightLogical, BitwiseAnd, uniform 0b110, shift_amounts 0b010),
                ShiftOr(Then, ShiftRightLogical, BitwiseOr, uniform 0b010, shift_amounts 0b010),
                ShiftLeftOr(Then, ShiftLeftLogical, BitwiseOr, uniform 0b010, shift_amounts 0b010),
                XorIMul(Then, BitwiseXor, IMul, uniform 0b100, shift_amounts 0),
                IMulIAdd(Then, IMul, IAdd, uniform 0b010, shift_amounts 0),
                IAddIAdd(Then, IAdd, IAdd, uniform 0b110, shift_amounts 0),
                IAddIMul(Then, IAdd, IMul, uniform 0b110, shift_amounts 0),
            }
            chains {
                // Two rounds of a hash's bit mixing: shift, exclusive or, multiplication.
                MixTwice(Chain, ShiftXorIMul, ShiftXorIMul, uniform 0b11110, shift_amounts 0b01010),
                // These, and the shift and exclusive or of a third round.
                Mix(Chain, MixTwice, ShiftXor, uniform 0b111110, shift_amounts 0b101010),
                NegMulAddMul(Chain, NegMulAdd, FMul, uniform 0b0110, shift_amounts 0),
                // `a * b + c * d`: a dot product of two components, as in products of matrices and
                // vectors.
                DotProduct2(Last, FMul, MulAdd, uniform 0b1010, shift_amounts 0),
                DotProduct3(Last, DotProduct2, MulAdd, uniform 0b101010, shift_amounts 0),
            }
        }
    };
}
pub(crate) use for_each_superop;
