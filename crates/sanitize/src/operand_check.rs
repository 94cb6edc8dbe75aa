//! Rules about the operands of single instructions: a row each says which instruction, which of its
//! lane kernels, and which operands break the rule.

use anyhit_engine::module::Opcode;
use rspirv::spirv::GlslStd450Op as Glsl;

use crate::lane_operands::LaneOperands;
use crate::rule::{Rule, arithmetic};
use crate::word_range::WordRange;
use anyhit_engine::ops::bit::field;
use anyhit_engine::ops::glsl::parts;
use anyhit_engine::ops::lane_kernel::{LaneKernel, OpFamily};
use anyhit_engine::ops::{arithmetic as arithmetic_ops, bit, conversion, glsl, observed, relational_logical};

/// An instruction of SPIR-V or of `GLSL.std.450`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CheckedInstruction {
    /// An opcode.
    Core(Opcode),
    /// An extended instruction.
    Glsl(Glsl),
}

/// A rule about the operands of an instruction.
#[derive(Debug)]
pub struct OperandCheck {
    /// The rule.
    pub rule: &'static Rule,
    /// The instruction.
    pub instruction: CheckedInstruction,
    /// The lane kernel, among those that the instruction becomes, whose operands are checked.
    pub kernel: &'static OpFamily,
    /// The decoration of the instruction's result without which the rule does not apply.
    pub decoration: Option<u32>,
    /// The operands that decide whether the rule is broken.
    pub decided_by: &'static [usize],
    /// Operands of 32 bits, one of which lies in its range wherever the rule is broken, for a
    /// result of so many bits; none where nothing is known.
    pub suspects: fn(u32) -> Vec<(usize, WordRange)>,
    /// Whether the operands break the rule.
    pub breaks: fn(&LaneOperands) -> bool,
    /// What is wrong with them, for a report.
    pub message: fn(&LaneOperands) -> String,
}

/// The checks of an instruction that is executed by a lane kernel.
pub fn checks_of(
    instruction: CheckedInstruction,
    kernel: &LaneKernel,
) -> impl Iterator<Item = &'static OperandCheck> {
    let tables = [CHECKS, NO_SIGNED_WRAP_CHECKS, NO_UNSIGNED_WRAP_CHECKS];
    let all = tables.into_iter().flatten();
    all.filter(move |check| check.instruction == instruction && kernel.is(check.kernel))
}

/// Makes a table of the rows of rules, one for each instruction, under a decoration or without. In
/// brackets stand the operands that decide and, where they are known, the suspects.
macro_rules! rows {
    (@decided_by [$($at:literal),* $(; $bits:pat => $($suspect:expr),*)?]) => { &[$($at),*] };
    (@suspects [$($at:literal),*]) => { |_| Vec::new() };
    (@suspects [$($at:literal),*; $bits:pat => $($suspect:expr),*]) => { |$bits| vec![$($suspect),*] };
    (
        $(#[$doc:meta])* $table:ident $decoration:expr;
        $($rule:ident $operands:tt: $($set:ident $name:ident ($kernel:path)),* => $breaks:expr, $message:expr;)*
    ) => {
        $(#[$doc])*
        static $table: &[OperandCheck] = &[$($(OperandCheck {
            rule: &arithmetic::$rule,
            instruction: CheckedInstruction::$set($set::$name),
            kernel: &$kernel,
            decoration: $decoration,
            decided_by: rows!(@decided_by $operands),
            suspects: rows!(@suspects $operands),
            breaks: $breaks,
            message: $message,
        }),*),*];
    };
}

use Opcode as Core;
use WordRange as R;

rows! {
    /// Checks of operations that are decorated `NoSignedWrap`.
    NO_SIGNED_WRAP_CHECKS Some(4469);
    NO_WRAP_BROKEN [0, 1]: Core IAdd (arithmetic_ops::IAdd)
        => |o| o.overflows_signed(|a, b| a + b),
        |o| format!("the signed sum {}, which NoSignedWrap rules out", o.describe_sum("+", true));
    NO_WRAP_BROKEN [0, 1]: Core ISub (arithmetic_ops::ISub)
        => |o| o.overflows_signed(|a, b| a - b),
        |o| format!("the signed difference {}, which NoSignedWrap rules out", o.describe_sum("-", true));
    NO_WRAP_BROKEN [0, 1]: Core IMul (arithmetic_ops::IMul)
        => |o| o.overflows_signed(|a, b| a * b),
        |o| format!("the signed product {}, which NoSignedWrap rules out", o.describe_sum("*", true));
    NO_WRAP_BROKEN [0, 1]: Core ShiftLeftLogical (bit::ShiftLeftLogical)
        => |o| o.shifts_out(true),
        |o| format!("the signed shift {}, which NoSignedWrap rules out", o.describe_sum("<<", true));
    NO_WRAP_BROKEN [0]: Core SNegate (arithmetic_ops::SNegate)
        => |o| o.signed(0) == o.least(),
        |o| format!("the negation of {}, the least integer, which NoSignedWrap rules out", o.signed(0));
}

rows! {
    /// Checks of operations that are decorated `NoUnsignedWrap`.
    NO_UNSIGNED_WRAP_CHECKS Some(4470);
    NO_WRAP_BROKEN [0, 1]: Core IAdd (arithmetic_ops::IAdd)
        => |o| o.overflows_unsigned(|a, b| a.checked_add(b)),
        |o| format!("the unsigned sum {}, which NoUnsignedWrap rules out", o.describe_sum("+", false));
    NO_WRAP_BROKEN [0, 1]: Core ISub (arithmetic_ops::ISub)
        => |o| o.overflows_unsigned(|a, b| a.checked_sub(b)),
        |o| format!("the unsigned difference {}, which NoUnsignedWrap rules out", o.describe_sum("-", false));
    NO_WRAP_BROKEN [0, 1]: Core IMul (arithmetic_ops::IMul)
        => |o| o.overflows_unsigned(|a, b| a.checked_mul(b)),
        |o| format!("the unsigned product {}, which NoUnsignedWrap rules out", o.describe_sum("*", false));
    NO_WRAP_BROKEN [0, 1]: Core ShiftLeftLogical (bit::ShiftLeftLogical)
        => |o| o.shifts_out(false),
        |o| format!("the unsigned shift {}, which NoUnsignedWrap rules out", o.describe_sum("<<", false));
    NO_WRAP_BROKEN [0]: Core SNegate (arithmetic_ops::SNegate)
        => |o| o.unsigned(0) != 0,
        |o| format!("the negation of {}, which NoUnsignedWrap rules out", o.unsigned(0));
}

rows! {
    /// Checks of operations whatever their decorations.
    CHECKS None;
    INT_DIV_ZERO [1; _ => (1, R::ZERO)]: Core UDiv (arithmetic_ops::UDiv), Core SDiv (arithmetic_ops::SDiv)
        => |o| o.unsigned(1) == 0, |o| format!("the division of {} by zero", o.describe(0, true));
    INT_DIV_ZERO [1; _ => (1, R::ZERO)]: Core UMod (arithmetic_ops::UMod), Core SRem (arithmetic_ops::SRem), Core SMod (arithmetic_ops::SMod)
        => |o| o.unsigned(1) == 0,
        |o| format!("the remainder of {} divided by zero", o.describe(0, true));
    INT_DIV_OVERFLOW [0, 1; _ => (0, R::LEAST)]: Core SDiv (arithmetic_ops::SDiv), Core SRem (arithmetic_ops::SRem), Core SMod (arithmetic_ops::SMod)
        => |o| o.signed(0) == o.least() && o.signed(1) == -1,
        |o| format!("the division of {}, the least integer, by -1", o.signed(0));
    SREM_NEGATIVE [0, 1; _ => (0, R::NEGATIVE), (1, R::NEGATIVE)]: Core SRem (arithmetic_ops::SRem), Core SMod (arithmetic_ops::SMod)
        => |o| o.unsigned(1) != 0 && (o.signed(0) < 0 || o.signed(1) < 0),
        |o| format!("the remainder of {} divided by {}", o.signed(0), o.signed(1));
    SHIFT_RANGE [1; _ => (1, R::from(32))]: Core ShiftLeftLogical (bit::ShiftLeftLogical), Core ShiftRightLogical (bit::ShiftRightLogical),
        Core ShiftRightArithmetic (bit::ShiftRightArithmetic)
        => |o| o.unsigned(1) >= u64::from(o.width),
        |o| format!("a shift by {} of a value of {} bits", o.unsigned(1), o.width);
    BITFIELD_RANGE [0, 1]: Core BitFieldInsert (field::FieldMask)
        => |o| o.unsigned(0) + o.unsigned(1) > u64::from(o.width),
        |o| format!("a bit field of {} bits at offset {} in {} bits", o.unsigned(1), o.unsigned(0), o.width);
    BITFIELD_RANGE [1, 2]: Core BitFieldSExtract (field::FieldSExtract), Core BitFieldUExtract (field::FieldUExtract)
        => |o| o.unsigned(1) + o.unsigned(2) > u64::from(o.width),
        |o| format!("a bit field of {} bits at offset {} in {} bits", o.unsigned(2), o.unsigned(1), o.width);
    DOT_OVERFLOW [0, 1]: Core SDotAccSat (arithmetic_ops::IMul), Core SUDotAccSat (arithmetic_ops::IMul)
        => |o| o.overflows_signed(|a, b| a * b),
        |o| format!("the product {} of a dot product", o.describe_sum("*", true));
    DOT_OVERFLOW [0, 1]: Core SDotAccSat (arithmetic_ops::IAdd), Core SUDotAccSat (arithmetic_ops::IAdd)
        => |o| o.overflows_signed(|a, b| a + b),
        |o| format!("the sum {} of a dot product", o.describe_sum("+", true));
    DOT_OVERFLOW [0, 1]: Core UDotAccSat (arithmetic_ops::IMul)
        => |o| o.overflows_unsigned(|a, b| a.checked_mul(b)),
        |o| format!("the product {} of a dot product", o.describe_sum("*", false));
    DOT_OVERFLOW [0, 1]: Core UDotAccSat (arithmetic_ops::IAdd)
        => |o| o.overflows_unsigned(|a, b| a.checked_add(b)),
        |o| format!("the sum {} of a dot product", o.describe_sum("+", false));
    INT_ABS_MIN [0; _ => (0, R::LEAST)]: Core SNegate (arithmetic_ops::SNegate), Glsl SAbs (glsl::SAbs)
        => |o| o.signed(0) == o.least(), |o| format!("the negation of {}, the least integer", o.signed(0));
    FREM_ZERO [1; _ => (1, R::FLOAT_ZERO)]: Core FRem (arithmetic_ops::FRem), Core FMod (arithmetic_ops::FMod)
        => |o| o.float(1) == 0.0, |o| format!("the remainder of {} divided by zero", o.describe(0, false));
    ASIN_ACOS [0; _ => (0, R::magnitude_from(1.0))]: Glsl Asin (glsl::Asin) => |o| o.float(0).abs() > 1.0, |o| format!("asin({})", o.describe(0, false));
    ASIN_ACOS [0; _ => (0, R::magnitude_from(1.0))]: Glsl Acos (glsl::Acos) => |o| o.float(0).abs() > 1.0, |o| format!("acos({})", o.describe(0, false));
    ACOSH_ATANH [0]: Glsl Acosh (glsl::Acosh) => |o| o.float(0) < 1.0, |o| format!("acosh({})", o.describe(0, false));
    ACOSH_ATANH [0; _ => (0, R::magnitude_from(1.0))]: Glsl Atanh (glsl::Atanh)
        => |o| o.float(0).abs() >= 1.0, |o| format!("atanh({})", o.describe(0, false));
    ATAN2_ZERO [0, 1; _ => (0, R::FLOAT_ZERO)]: Glsl Atan2 (glsl::Atan2)
        => |o| o.float(0) == 0.0 && o.float(1) == 0.0,
        |o| format!("atan({}, {})", o.describe(0, false), o.describe(1, false));
    POW_DOMAIN [0, 1; _ => (0, R::NOT_POSITIVE)]: Glsl Pow (glsl::Pow)
        => |o| o.float(0) < 0.0 || (o.float(0) == 0.0 && o.float(1) <= 0.0),
        |o| format!("pow({}, {})", o.describe(0, false), o.describe(1, false));
    LOG_DOMAIN [0; _ => (0, R::NOT_POSITIVE)]: Glsl Log (glsl::Log) => |o| o.float(0) <= 0.0, |o| format!("log({})", o.describe(0, false));
    LOG_DOMAIN [0; _ => (0, R::NOT_POSITIVE)]: Glsl Log2 (glsl::Log2) => |o| o.float(0) <= 0.0, |o| format!("log2({})", o.describe(0, false));
    SQRT_DOMAIN [0; _ => (0, R::NOT_POSITIVE)]: Glsl Sqrt (glsl::Sqrt) => |o| o.float(0) < 0.0, |o| format!("sqrt({})", o.describe(0, false));
    SQRT_DOMAIN [0; _ => (0, R::NOT_POSITIVE)]: Glsl InverseSqrt (glsl::InverseSqrt)
        => |o| o.float(0) <= 0.0, |o| format!("inversesqrt({})", o.describe(0, false));
    MINMAX_NAN [0, 1; _ => (0, R::NAN), (1, R::NAN)]: Glsl FMin (glsl::FMin)
        => |o| o.float(0).is_nan() || o.float(1).is_nan(),
        |o| format!("min({}, {})", o.describe(0, false), o.describe(1, false));
    MINMAX_NAN [0, 1; _ => (0, R::NAN), (1, R::NAN)]: Glsl FMax (glsl::FMax)
        => |o| o.float(0).is_nan() || o.float(1).is_nan(),
        |o| format!("max({}, {})", o.describe(0, false), o.describe(1, false));
    MINMAX_NAN [0, 1; _ => (0, R::NAN), (1, R::NAN)]: Glsl Step (glsl::Step)
        => |o| o.float(0).is_nan() || o.float(1).is_nan(),
        |o| format!("step({}, {})", o.describe(0, false), o.describe(1, false));
    MINMAX_NAN [0, 1, 2; _ => (0, R::NAN), (1, R::NAN), (2, R::NAN)]: Glsl FClamp (glsl::FClamp)
        => |o| (0..3).any(|at| o.float(at).is_nan()),
        |o| format!("clamp({}, {}, {})", o.describe(0, false), o.describe(1, false), o.describe(2, false));
    CLAMP_INVERTED [1, 2]: Glsl FClamp (glsl::FClamp), Glsl NClamp (glsl::NClamp)
        => |o| o.float(1) > o.float(2),
        |o| format!("clamp({}, {}, {})", o.describe(0, false), o.describe(1, false), o.describe(2, false));
    CLAMP_INVERTED [1, 2]: Glsl UClamp (glsl::UClamp)
        => |o| o.unsigned(1) > o.unsigned(2),
        |o| format!("clamp({}, {}, {})", o.unsigned(0), o.unsigned(1), o.unsigned(2));
    CLAMP_INVERTED [1, 2]: Glsl SClamp (glsl::SClamp)
        => |o| o.signed(1) > o.signed(2),
        |o| format!("clamp({}, {}, {})", o.signed(0), o.signed(1), o.signed(2));
    SMOOTHSTEP_EDGES [0, 1]: Glsl SmoothStep (glsl::SmoothStep)
        => |o| o.float(0) >= o.float(1),
        |o| format!("smoothstep({}, {}, ...)", o.describe(0, false), o.describe(1, false));
    NORMALIZE_ZERO [0; _ => (0, R::FLOAT_ZERO), (0, R::SPECIAL)]: Glsl Normalize (glsl::InverseSqrt)
        => |o| o.float(0) == 0.0 || o.float(0).is_infinite(),
        |o| match o.float(0) == 0.0 {
            true => "the normalization of a vector whose length, or its square, is 0".to_owned(),
            false => "the normalization of a vector whose squared length overflows".to_owned(),
        };
    LDEXP_RANGE [1]: Glsl Ldexp (glsl::Ldexp)
        => |o| i64::from(o.unsigned(1) as u32 as i32) > match o.width { 16 => 16, 32 => 128, _ => 1024 },
        |o| format!("ldexp({}, {})", o.describe(0, false), o.unsigned(1) as u32 as i32);
    INVERSE_SINGULAR [1; _ => (1, R::FLUSHED), (1, R::SPECIAL)]: Glsl MatrixInverse (arithmetic_ops::FDiv)
        => |o| o.float(1).abs() < o.least_normal() || o.float(1).is_infinite(),
        |o| format!("the inverse of a matrix whose determinant is {}", o.describe(1, false));
    PACKDOUBLE_SPECIAL [1]: Glsl PackDouble2x32 (observed::PackedDouble)
        => |o| o.unsigned(1) >> 20 & 0x7FF == 0x7FF,
        |o| format!("packDouble2x32(uvec2({:#x}, {:#x})), no finite number", o.unsigned(0), o.unsigned(1));
    ASSUME_FALSE [0; _ => (0, R::ZERO)]: Core AssumeTrueKHR (observed::Assumption)
        => |o| o.unsigned(0) == 0, |_| "an assumption that is false".to_owned();
    TRIG_SPECIAL [0; _ => (0, R::SPECIAL)]: Glsl Sin (glsl::Sin)
        => |o| o.float(0).is_infinite(), |o| format!("sin({})", o.describe(0, false));
    TRIG_SPECIAL [0; _ => (0, R::SPECIAL)]: Glsl Cos (glsl::Cos)
        => |o| o.float(0).is_infinite(), |o| format!("cos({})", o.describe(0, false));
    TRIG_SPECIAL [0; _ => (0, R::SPECIAL)]: Glsl Tan (glsl::Tan)
        => |o| o.float(0).is_infinite(), |o| format!("tan({})", o.describe(0, false));
    TRIG_SPECIAL [0; _ => (0, R::SPECIAL)]: Glsl Fract (glsl::Fract)
        => |o| o.float(0).is_infinite(), |o| format!("fract({})", o.describe(0, false));
    FLOAT_NARROW [0]: Core FConvert (conversion::CONVERT)
        => |o| o.narrows_to_infinity(o.float_result),
        |o| format!("the conversion of {} to a float of {} bits", o.describe(0, false), o.float_result);
    FLOAT_NARROW [0]: Glsl PackHalf2x16 (parts::Half)
        => |o| o.narrows_to_infinity(16), |o| format!("the conversion of {} to a half", o.describe(0, false));
    FREXP_SPECIAL [0; _ => (0, R::SPECIAL)]: Glsl Frexp (parts::FrexpMantissa), Glsl FrexpStruct (parts::FrexpMantissa)
        => |o| !o.float(0).is_finite(), |o| format!("frexp({})", o.describe(0, false));
    FLOAT_TO_INT [0; bits => (0, R::power_from(bits - 1))]: Core ConvertFToS (conversion::CONVERT)
        => |o| !o.fits(true),
        |o| format!("the conversion of {} to a signed integer of {} bits", o.describe(0, false), o.result_width);
    FLOAT_TO_INT [0; bits => (0, R::NEGATIVE), (0, R::power_from(bits))]: Core ConvertFToU (conversion::CONVERT)
        => |o| !o.fits(false),
        |o| format!("the conversion of {} to an unsigned integer of {} bits", o.describe(0, false), o.result_width);
    FDIV_RANGE [1; _ => (1, R::magnitude_from(8.507_059e37))]: Core FDiv (arithmetic_ops::FDiv)
        => |o| o.float(1).is_finite() && o.float(1).abs() > 2f64.powi(o.greatest_divisor()),
        |o| format!(
            "{} / {}: the error of a division is not bounded where its divisor is above 2^{}",
            o.describe(0, false), o.describe(1, false), o.greatest_divisor()
        );
    ROUND_HALF [0]: Glsl Round (glsl::Round)
        => |o| o.float(0).fract().abs() == 0.5,
        |o| format!("round({}), which may be {} or {}", o.describe(0, false), o.float(0).floor(), o.float(0).ceil());
    SIGN_NAN [0; _ => (0, R::NAN)]: Glsl FSign (glsl::FSign)
        => |o| o.float(0).is_nan(), |_| "sign() of a NaN".to_owned();
    REFLECT_UNIT [0; _ => (0, R::outside(0.981, 1.02))]: Glsl Reflect (observed::SquaredLength)
        => |o| !o.is_square_of_unit(),
        |o| format!("reflect() by a normal of length {:.4}", o.float(0).sqrt());
    REFLECT_UNIT [0; _ => (0, R::outside(0.981, 1.02))]: Glsl Refract (observed::SquaredLength)
        => |o| !o.is_square_of_unit(),
        |o| format!("refract() of a vector of length {:.4}", o.float(0).sqrt());
    NAN_TEST_FOLDED [0; _ => (0, R::SPECIAL)]: Core IsNan (relational_logical::IsNan) => |o| o.float(0).is_nan(),
        |_| "isnan() holds, though it may be folded to false: the shader does not preserve NaN".into();
    NAN_TEST_FOLDED [0; _ => (0, R::SPECIAL)]: Core IsInf (relational_logical::IsInf) => |o| o.float(0).is_infinite(),
        |_| "isinf() holds, though it may be folded to false: the shader does not preserve infinity".into();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flushed_use::FlushedUse;
    use anyhit_engine::machine::{Reg, Registers};
    use anyhit_engine::ops::conversion::{Conversion, kernel};
    use anyhit_engine::ops::lane_kernel::{InstructionSet, family};

    fn operands(kernel: &LaneKernel, result_width: u32, bits: [u64; 3]) -> LaneOperands {
        let mut registers = Registers::<1>::new(6);
        for (at, bits) in bits.into_iter().enumerate() {
            registers.set_lane_words(Reg(2 * at as u32), 0, [bits as u32, (bits >> 32) as u32]);
        }
        LaneOperands::read(&registers, kernel, &[Reg(0), Reg(2), Reg(4)], result_width, 0)
    }

    fn broken(instruction: CheckedInstruction, width: u32, bits: [u64; 3]) -> Vec<&'static str> {
        broken_under(None, instruction, width, bits)
    }

    /// The rules of an undecorated or decorated instruction that its operands break.
    fn broken_under(
        decoration: Option<u32>,
        instruction: CheckedInstruction,
        width: u32,
        bits: [u64; 3],
    ) -> Vec<&'static str> {
        let (set, number) = match instruction {
            CheckedInstruction::Core(op) => (InstructionSet::Core, op.0.into()),
            CheckedInstruction::Glsl(op) => (InstructionSet::Glsl, op as u32),
        };
        let kernel = family(set, number).and_then(|family| family.kernel(width)).expect("a kernel");
        let operands = operands(kernel, width, bits);
        let applying = checks_of(instruction, kernel).filter(|check| check.decoration == decoration);
        applying.filter(|check| (check.breaks)(&operands)).map(|check| check.rule.id).collect()
    }

    fn floats(values: [f32; 3]) -> [u64; 3] {
        values.map(|value| value.to_bits().into())
    }

    /// LaneOperands at both sides of what each section of the specifications says.
    #[test]
    fn operands_break_the_rules_of_their_instructions() {
        let divide = CheckedInstruction::Core(Opcode::SDiv);
        let negative = u64::from((-3i32) as u32);
        assert_eq!(broken(divide, 32, [7, 0, 0]), ["int-div-zero"]);
        assert_eq!(broken(divide, 32, [0x8000_0000, 0xFFFF_FFFF, 0]), ["int-div-overflow"]);
        assert_eq!(broken(divide, 64, [0x8000_0000, u64::MAX, 0]), [""; 0]);
        assert_eq!(broken(divide, 16, [0x8000, 0xFFFF, 0]), ["int-div-overflow"]);
        assert_eq!(broken(divide, 32, [negative, 2, 0]), [""; 0]);
        let remainder = CheckedInstruction::Core(Opcode::SRem);
        assert_eq!(broken(remainder, 32, [negative, 2, 0]), ["srem-negative"]);
        assert_eq!(broken(remainder, 32, [3, 2, 0]), [""; 0]);
        let shift = CheckedInstruction::Core(Opcode::ShiftLeftLogical);
        assert_eq!(broken(shift, 32, [1, 32, 0]), ["shift-range"]);
        assert_eq!(broken(shift, 32, [1, 31, 0]), [""; 0]);
        assert_eq!(broken(shift, 64, [1, 32, 0]), [""; 0]);
        let pow = CheckedInstruction::Glsl(Glsl::Pow);
        assert_eq!(broken(pow, 32, floats([-0.5, 2.0, 0.0])), ["pow-domain"]);
        assert_eq!(broken(pow, 32, floats([0.0, 0.0, 0.0])), ["pow-domain"]);
        assert_eq!(broken(pow, 32, floats([0.0, 2.0, 0.0])), [""; 0]);
        let min = CheckedInstruction::Glsl(Glsl::FMin);
        assert_eq!(broken(min, 32, floats([f32::NAN, 1.0, 0.0])), ["minmax-nan"]);
        assert_eq!(broken(min, 32, floats([f32::INFINITY, 1.0, 0.0])), [""; 0]);
        let clamp = CheckedInstruction::Glsl(Glsl::FClamp);
        assert_eq!(broken(clamp, 32, floats([0.5, 1.0, 0.0])), ["clamp-inverted"]);
        assert_eq!(broken(clamp, 32, floats([0.5, 1.0, 1.0])), [""; 0]);
        let smoothstep = CheckedInstruction::Glsl(Glsl::SmoothStep);
        assert_eq!(broken(smoothstep, 32, floats([1.0, 0.0, 0.5])), ["smoothstep-edges"]);
        let ldexp = CheckedInstruction::Glsl(Glsl::Ldexp);
        assert_eq!(broken(ldexp, 32, [1, 129, 0]), ["ldexp-range"]);
        assert_eq!(broken(ldexp, 32, [1, 128, 0]), [""; 0]);
    }

    /// Operands at and around all limits break a rule only where one of them is a suspect.
    #[test]
    fn operands_that_break_a_rule_are_suspects() {
        let limits = [0, 1, 31, 32, 0x7FFF_FFFF, 0x8000_0000, 0x8000_0001, 0xFFFF_FFFF].into_iter();
        let floats = [0.98f32, 0.9801, 0.99, 1.0, 1.0201, 1.03, 255.0, 256.0, 32767.0, 2_147_483_648.0];
        let more = [4_294_967_296.0f32, 2f32.powi(126), 2f32.powi(127), f32::MAX, 1e-40, 1e-38];
        let special = [f32::INFINITY, f32::NAN].into_iter().chain(floats).chain(more);
        let around = |bits: u32| [bits.wrapping_sub(1), bits, bits.wrapping_add(1)];
        let signs = |bits: u32| [bits, bits ^ 1 << 31];
        let words: Vec<u32> =
            limits.chain(special.map(f32::to_bits)).flat_map(signs).flat_map(around).collect();
        // Of three operands that are floats, or integers of that width.
        let kernel = family(InstructionSet::Glsl, Glsl::FClamp as u32).and_then(|family| family.kernel(32));
        let kernel = kernel.expect("a kernel");
        let tables = [CHECKS, NO_SIGNED_WRAP_CHECKS, NO_UNSIGNED_WRAP_CHECKS];
        let mut known = 0;
        for (check, bits) in tables.into_iter().flatten().flat_map(|check| [(check, 16), (check, 32)]) {
            let suspects = (check.suspects)(bits);
            known += suspects.len();
            if suspects.is_empty() {
                continue;
            }
            let pairs = words.iter().flat_map(|&a| words.iter().map(move |&b| (a, b)));
            for words in pairs.flat_map(|(a, b)| [[a, b, a], [b, a, b], [a, a, b]]) {
                let is_suspect = suspects.iter().any(|&(at, range)| range.contains(words[at]));
                let breaks = (check.breaks)(&operands(kernel, bits, words.map(u64::from)));
                assert!(is_suspect || !breaks, "{:?} {words:x?}", check.instruction);
            }
        }
        assert!(known > 60, "{known} suspects");
    }

    #[test]
    fn operations_without_wrap_do_not_overflow() {
        let wraps = |decoration, op, width, bits| {
            !broken_under(Some(decoration), CheckedInstruction::Core(op), width, bits).is_empty()
        };
        let [signed, unsigned] = [4469, 4470];
        let minus = |number: i32| u64::from(number as u32);
        assert!(wraps(signed, Opcode::IAdd, 32, [0x7FFF_FFFF, 1, 0]));
        assert!(!wraps(unsigned, Opcode::IAdd, 32, [0x7FFF_FFFF, 1, 0]));
        assert!(wraps(unsigned, Opcode::IAdd, 32, [minus(-1), 1, 0]));
        assert!(!wraps(signed, Opcode::IAdd, 32, [minus(-1), 1, 0]));
        assert!(wraps(unsigned, Opcode::IAdd, 64, [u64::MAX, 1, 0]));
        assert!(wraps(signed, Opcode::ISub, 16, [0x8000, 1, 0]));
        assert!(wraps(unsigned, Opcode::ISub, 32, [3, 4, 0]));
        assert!(!wraps(signed, Opcode::ISub, 32, [3, 4, 0]));
        assert!(wraps(signed, Opcode::IMul, 64, [u64::MAX, 1 << 63, 0]));
        assert!(!wraps(signed, Opcode::IMul, 32, [minus(-2), 1 << 30, 0]));
        assert!(wraps(unsigned, Opcode::IMul, 64, [u64::MAX, u64::MAX, 0]));
        assert!(wraps(signed, Opcode::ShiftLeftLogical, 32, [1, 31, 0]));
        assert!(!wraps(unsigned, Opcode::ShiftLeftLogical, 32, [1, 31, 0]));
        assert!(!wraps(signed, Opcode::ShiftLeftLogical, 32, [minus(-1), 31, 0]));
        // That a shift is too wide is another rule's.
        assert!(!wraps(unsigned, Opcode::ShiftLeftLogical, 32, [1, 32, 0]));
        assert!(wraps(signed, Opcode::SNegate, 32, [0x8000_0000, 0, 0]));
        assert!(wraps(unsigned, Opcode::SNegate, 32, [1, 0, 0]));
    }

    #[test]
    fn a_finite_float_narrows_to_infinity_from_half_a_step_above_the_greatest_on() {
        let kernel = kernel(Conversion::F, 32, 16).expect("a kernel");
        let breaks = |value: f32| {
            let operands = operands(kernel, 16, [value.to_bits().into(), 0, 0]);
            checks_of(CheckedInstruction::Core(Opcode::FConvert), kernel)
                .any(|check| (check.breaks)(&operands))
        };
        assert_eq!(
            [65504.0, 65519.996, 65520.0, -1e9, f32::INFINITY].map(breaks),
            [false, false, true, true, false]
        );
    }

    #[test]
    fn a_float_fits_in_an_integer_if_its_whole_part_does() {
        let breaks = |kind, width, instruction, value: f32| {
            let kernel = kernel(kind, 32, width).expect("a kernel");
            let operands = operands(kernel, width, [value.to_bits().into(), 0, 0]);
            checks_of(CheckedInstruction::Core(instruction), kernel).any(|check| (check.breaks)(&operands))
        };
        let unsigned = |width, value| breaks(Conversion::FToU, width, Opcode::ConvertFToU, value);
        let signed = |width, value| breaks(Conversion::FToS, width, Opcode::ConvertFToS, value);
        // -0.9 becomes 0.
        assert_eq!(
            [unsigned(32, -0.9), unsigned(32, -1.0), unsigned(32, 4_294_967_040.0)],
            [false, true, false]
        );
        assert_eq!(
            [unsigned(32, 4_294_967_296.0), unsigned(8, 255.9), unsigned(8, 256.0)],
            [true, false, true]
        );
        assert_eq!([signed(32, -2_147_483_648.0), signed(32, 2_147_483_648.0)], [false, true]);
        assert_eq!([signed(32, f32::NAN), signed(64, f32::INFINITY)], [true, true]);
    }

    #[test]
    fn halves_nans_and_great_divisors_are_lints() {
        let round = CheckedInstruction::Glsl(Glsl::Round);
        assert_eq!(broken(round, 32, floats([-2.5, 0.0, 0.0])), ["round-half"]);
        assert_eq!(broken(round, 32, floats([2.499_999_8, 0.0, 0.0])), [""; 0]);
        let sign = CheckedInstruction::Glsl(Glsl::FSign);
        assert_eq!(broken(sign, 32, floats([f32::NAN, 0.0, 0.0])), ["sign-nan"]);
        assert_eq!(broken(sign, 32, floats([f32::INFINITY, 0.0, 0.0])), [""; 0]);
        let divide = CheckedInstruction::Core(Opcode::FDiv);
        assert_eq!(broken(divide, 32, floats([1.0, 2f32.powi(126), 0.0])), [""; 0]);
        assert_eq!(broken(divide, 32, floats([1.0, -2f32.powi(127), 0.0])), ["fdiv-range"]);
        // A quotient by infinity is 0, as slab tests expect.
        assert_eq!(broken(divide, 32, floats([1.0, f32::INFINITY, 0.0])), [""; 0]);
        // 2^14 and 2^15 as halves.
        assert_eq!(broken(divide, 16, [0x3C00, 0x7400, 0]), [""; 0]);
        assert_eq!(broken(divide, 16, [0x3C00, 0x7800, 0]), ["fdiv-range"]);
    }

    #[test]
    fn flushing_matters_where_it_changes_what_a_comparison_gives() {
        let compare = family(InstructionSet::Core, u32::from(Opcode::FOrdLessThan.0));
        let kernel = compare.and_then(|family| family.kernel(32));
        let kernel = kernel.expect("a kernel");
        let matters = |flushed, a, b| operands(kernel, 32, floats([a, b, 0.0])).flushing_matters(flushed);
        assert!(matters(FlushedUse::Below, 1e-40, 2e-40));
        assert!(!matters(FlushedUse::Below, 1e-40, 1.0));
        assert!(!matters(FlushedUse::Below, 1e-40, 0.0));
        assert!(matters(FlushedUse::Above, 1e-40, 0.0));
        assert!(matters(FlushedUse::Equal, 1e-40, 0.0));
        assert!(!matters(FlushedUse::Equal, 1e-40, f32::MIN_POSITIVE));
        assert!(matters(FlushedUse::Divisor, 1.0, 1e-40));
        assert!(!matters(FlushedUse::Divisor, 1e-40, 1.0));
    }
}
