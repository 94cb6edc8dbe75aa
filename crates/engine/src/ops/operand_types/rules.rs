//! The rules: instructions with operands of the same types share one.

use rspirv::spirv::{GlslStd450Op as G, Op};

use crate::ops::operand_types::TypeConstraint::{
    self, Any, Bits, ComponentOf, Condition, MemberOf, OfKind, OtherWidth, Pair, Pointee, PointerTo, SameAs,
    SameCount, SameShape, Scalar, ScalarBits, ScalarOrVectorOf, Vector, VectorBits, VectorOf,
};
use crate::ops::operand_types::kinds::{BOOL, FLOAT, INT, SCALAR, UINT};

/// The types of an instruction's result and operands.
#[derive(Debug)]
pub struct OperandTypeRule {
    /// The constraint on the result.
    pub result: TypeConstraint,
    /// The constraints on the operands; any further operands have none.
    pub operands: &'static [TypeConstraint],
}

/// A rule.
pub(super) const fn rule(result: TypeConstraint, operands: &'static [TypeConstraint]) -> OperandTypeRule {
    OperandTypeRule { result, operands }
}

static FLOAT_UNARY: OperandTypeRule = rule(OfKind(FLOAT), &[SameAs(0)]);
static FLOAT_BINARY: OperandTypeRule = rule(OfKind(FLOAT), &[SameAs(0), SameAs(0)]);
static FLOAT_TERNARY: OperandTypeRule = rule(OfKind(FLOAT), &[SameAs(0), SameAs(0), SameAs(0)]);
static INT_UNARY: OperandTypeRule = rule(OfKind(INT), &[SameShape(INT, 0)]);
static INT_BINARY: OperandTypeRule = rule(OfKind(INT), &[SameShape(INT, 0), SameShape(INT, 0)]);
static INT_TERNARY: OperandTypeRule =
    rule(OfKind(INT), &[SameShape(INT, 0), SameShape(INT, 0), SameShape(INT, 0)]);
static UINT_BINARY: OperandTypeRule = rule(OfKind(UINT), &[SameAs(0), SameAs(0)]);
static BOOL_BINARY: OperandTypeRule = rule(OfKind(BOOL), &[SameAs(0), SameAs(0)]);

/// The rule of an opcode; `None` where its translator checks for itself.
pub fn core(number: u16) -> Option<&'static OperandTypeRule> {
    Some(match Op::from_u32(number.into())? {
        Op::FNegate => &FLOAT_UNARY,
        Op::FAdd | Op::FSub | Op::FMul | Op::FDiv | Op::FRem | Op::FMod => &FLOAT_BINARY,
        Op::FmaKHR => &FLOAT_TERNARY,
        Op::UDiv | Op::UMod => &UINT_BINARY,
        Op::SNegate | Op::Not => &INT_UNARY,
        Op::IAdd | Op::ISub | Op::IMul | Op::SDiv | Op::SMod | Op::SRem => &INT_BINARY,
        Op::BitwiseOr | Op::BitwiseXor | Op::BitwiseAnd => &INT_BINARY,
        Op::IAddCarry | Op::ISubBorrow | Op::UMulExtended => {
            static RULE: OperandTypeRule = rule(Pair(UINT), &[MemberOf(0), MemberOf(0)]);
            &RULE
        }
        Op::SMulExtended => {
            static RULE: OperandTypeRule = rule(Pair(INT), &[MemberOf(0), MemberOf(0)]);
            &RULE
        }
        Op::Dot => {
            static RULE: OperandTypeRule = rule(Scalar(FLOAT), &[VectorOf(0), SameAs(1)]);
            &RULE
        }
        Op::VectorTimesScalar => {
            static RULE: OperandTypeRule = rule(Vector(FLOAT), &[SameAs(0), ComponentOf(0)]);
            &RULE
        }
        Op::MatrixTimesScalar => {
            static RULE: OperandTypeRule = rule(Any, &[SameAs(0), ComponentOf(0)]);
            &RULE
        }
        Op::ShiftLeftLogical | Op::ShiftRightLogical | Op::ShiftRightArithmetic => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameShape(INT, 0), SameCount(INT, 0)]);
            &RULE
        }
        Op::BitFieldInsert => {
            static RULE: OperandTypeRule =
                rule(OfKind(INT), &[SameAs(0), SameAs(0), Scalar(INT), Scalar(INT)]);
            &RULE
        }
        Op::BitFieldSExtract | Op::BitFieldUExtract => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameAs(0), Scalar(INT), Scalar(INT)]);
            &RULE
        }
        Op::BitReverse => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameAs(0)]);
            &RULE
        }
        Op::BitCount => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameCount(INT, 0)]);
            &RULE
        }
        Op::Any | Op::All => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Vector(BOOL)]);
            &RULE
        }
        Op::IsNan | Op::IsInf => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[SameCount(FLOAT, 0)]);
            &RULE
        }
        Op::FOrdEqual
        | Op::FUnordEqual
        | Op::FOrdNotEqual
        | Op::FUnordNotEqual
        | Op::FOrdLessThan
        | Op::FUnordLessThan
        | Op::FOrdGreaterThan
        | Op::FUnordGreaterThan
        | Op::FOrdLessThanEqual
        | Op::FUnordLessThanEqual
        | Op::FOrdGreaterThanEqual
        | Op::FUnordGreaterThanEqual
        | Op::LessOrGreater
        | Op::Ordered
        | Op::Unordered => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[SameCount(FLOAT, 0), SameAs(1)]);
            &RULE
        }
        Op::LogicalEqual | Op::LogicalNotEqual | Op::LogicalOr | Op::LogicalAnd => &BOOL_BINARY,
        Op::LogicalNot => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[SameAs(0)]);
            &RULE
        }
        Op::IEqual
        | Op::INotEqual
        | Op::UGreaterThan
        | Op::UGreaterThanEqual
        | Op::ULessThan
        | Op::ULessThanEqual
        | Op::SGreaterThan
        | Op::SGreaterThanEqual
        | Op::SLessThan
        | Op::SLessThanEqual => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[SameCount(INT, 0), SameShape(INT, 1)]);
            &RULE
        }
        Op::Select => {
            static RULE: OperandTypeRule = rule(Any, &[Condition(0), SameAs(0), SameAs(0)]);
            &RULE
        }
        Op::ConvertFToU => {
            static RULE: OperandTypeRule = rule(OfKind(UINT), &[SameCount(FLOAT, 0)]);
            &RULE
        }
        Op::ConvertFToS => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameCount(FLOAT, 0)]);
            &RULE
        }
        Op::ConvertSToF | Op::ConvertUToF => {
            static RULE: OperandTypeRule = rule(OfKind(FLOAT), &[SameCount(INT, 0)]);
            &RULE
        }
        Op::UConvert => {
            static RULE: OperandTypeRule = rule(OfKind(UINT), &[OtherWidth(INT, 0)]);
            &RULE
        }
        Op::SConvert => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[OtherWidth(INT, 0)]);
            &RULE
        }
        Op::FConvert => {
            static RULE: OperandTypeRule = rule(OfKind(FLOAT), &[OtherWidth(FLOAT, 0)]);
            &RULE
        }
        Op::QuantizeToF16 => {
            static RULE: OperandTypeRule = rule(Bits(FLOAT, 32), &[SameAs(0)]);
            &RULE
        }
        Op::SatConvertSToU => &INT_UNARY,
        Op::ArrayLength => {
            static RULE: OperandTypeRule = rule(ScalarBits(UINT, 32), &[]);
            &RULE
        }
        Op::PtrEqual | Op::PtrNotEqual => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, SameAs(1)]);
            &RULE
        }
        Op::PtrDiff => {
            static RULE: OperandTypeRule = rule(Scalar(INT), &[Any, SameAs(1)]);
            &RULE
        }
        Op::ConvertPtrToU => {
            static RULE: OperandTypeRule = rule(Scalar(UINT), &[]);
            &RULE
        }
        Op::ConvertUToPtr => {
            static RULE: OperandTypeRule = rule(Any, &[Scalar(INT)]);
            &RULE
        }
        Op::ImageGather | Op::ImageSparseGather => {
            static RULE: OperandTypeRule = rule(Any, &[Any, Any, ScalarBits(INT, 32)]);
            &RULE
        }
        Op::ImageSampleDrefImplicitLod
        | Op::ImageSampleDrefExplicitLod
        | Op::ImageSampleProjDrefImplicitLod
        | Op::ImageSampleProjDrefExplicitLod
        | Op::ImageSparseSampleDrefImplicitLod
        | Op::ImageSparseSampleDrefExplicitLod
        | Op::ImageDrefGather
        | Op::ImageSparseDrefGather => {
            static RULE: OperandTypeRule = rule(Any, &[Any, Any, ScalarBits(FLOAT, 32)]);
            &RULE
        }
        Op::CopyObject => {
            static RULE: OperandTypeRule = rule(Any, &[SameAs(0)]);
            &RULE
        }
        Op::VectorExtractDynamic => {
            static RULE: OperandTypeRule = rule(OfKind(SCALAR), &[VectorOf(0), Scalar(INT)]);
            &RULE
        }
        Op::VectorInsertDynamic => {
            static RULE: OperandTypeRule = rule(Vector(SCALAR), &[SameAs(0), ComponentOf(0), Scalar(INT)]);
            &RULE
        }
        Op::ExpectKHR => {
            static RULE: OperandTypeRule = rule(OfKind(INT | BOOL), &[SameAs(0), SameAs(0)]);
            &RULE
        }
        Op::Switch => {
            static RULE: OperandTypeRule = rule(Any, &[Scalar(INT)]);
            &RULE
        }
        Op::AssumeTrueKHR | Op::BranchConditional => {
            static RULE: OperandTypeRule = rule(Any, &[Scalar(BOOL)]);
            &RULE
        }
        Op::UCountLeadingZerosINTEL | Op::UCountTrailingZerosINTEL => &INT_UNARY,
        Op::AbsISubINTEL
        | Op::AbsUSubINTEL
        | Op::IAddSatINTEL
        | Op::UAddSatINTEL
        | Op::ISubSatINTEL
        | Op::USubSatINTEL
        | Op::IAverageINTEL
        | Op::UAverageINTEL
        | Op::IAverageRoundedINTEL
        | Op::UAverageRoundedINTEL => &INT_BINARY,
        Op::IMul32x16INTEL | Op::UMul32x16INTEL => {
            static RULE: OperandTypeRule = rule(Bits(INT, 32), &[SameShape(INT, 0), SameShape(INT, 0)]);
            &RULE
        }
        op => return subgroup(op).or_else(|| atomic(op)),
    })
}

/// The rule of a subgroup instruction, whose first operand is a scope.
fn subgroup(op: Op) -> Option<&'static OperandTypeRule> {
    Some(match op {
        Op::GroupNonUniformAll | Op::GroupNonUniformAny => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, Scalar(BOOL)]);
            &RULE
        }
        Op::GroupNonUniformAllEqual => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, OfKind(SCALAR)]);
            &RULE
        }
        Op::GroupNonUniformBroadcastFirst => {
            static RULE: OperandTypeRule = rule(OfKind(SCALAR), &[Any, SameAs(0)]);
            &RULE
        }
        Op::GroupNonUniformBroadcast
        | Op::GroupNonUniformShuffle
        | Op::GroupNonUniformShuffleXor
        | Op::GroupNonUniformShuffleUp
        | Op::GroupNonUniformShuffleDown
        | Op::GroupNonUniformRotateKHR
        | Op::GroupNonUniformQuadBroadcast
        | Op::GroupNonUniformQuadSwap => {
            static RULE: OperandTypeRule = rule(OfKind(SCALAR), &[Any, SameAs(0), Scalar(UINT)]);
            &RULE
        }
        Op::GroupNonUniformBallot => {
            static RULE: OperandTypeRule = rule(VectorBits(UINT, 32, 4), &[Any, Scalar(BOOL)]);
            &RULE
        }
        Op::GroupNonUniformInverseBallot => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, VectorBits(UINT, 32, 4)]);
            &RULE
        }
        Op::GroupNonUniformBallotBitExtract => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, VectorBits(UINT, 32, 4), Scalar(UINT)]);
            &RULE
        }
        Op::GroupNonUniformBallotBitCount => {
            static RULE: OperandTypeRule = rule(Scalar(UINT), &[Any, Any, VectorBits(UINT, 32, 4)]);
            &RULE
        }
        Op::GroupNonUniformBallotFindLSB | Op::GroupNonUniformBallotFindMSB => {
            static RULE: OperandTypeRule = rule(Scalar(UINT), &[Any, VectorBits(UINT, 32, 4)]);
            &RULE
        }
        Op::GroupNonUniformIAdd
        | Op::GroupNonUniformIMul
        | Op::GroupNonUniformSMin
        | Op::GroupNonUniformSMax
        | Op::GroupNonUniformBitwiseAnd
        | Op::GroupNonUniformBitwiseOr
        | Op::GroupNonUniformBitwiseXor => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[Any, Any, SameAs(0)]);
            &RULE
        }
        Op::GroupNonUniformUMin | Op::GroupNonUniformUMax => {
            static RULE: OperandTypeRule = rule(OfKind(UINT), &[Any, Any, SameAs(0)]);
            &RULE
        }
        Op::GroupNonUniformFAdd
        | Op::GroupNonUniformFMul
        | Op::GroupNonUniformFMin
        | Op::GroupNonUniformFMax => {
            static RULE: OperandTypeRule = rule(OfKind(FLOAT), &[Any, Any, SameAs(0)]);
            &RULE
        }
        Op::GroupNonUniformLogicalAnd | Op::GroupNonUniformLogicalOr | Op::GroupNonUniformLogicalXor => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[Any, Any, SameAs(0)]);
            &RULE
        }
        _ => return None,
    })
}

/// The rule of an atomic instruction: the pointer is followed by scope and semantics, two for a
/// comparison.
fn atomic(op: Op) -> Option<&'static OperandTypeRule> {
    Some(match op {
        Op::AtomicLoad | Op::AtomicIIncrement | Op::AtomicIDecrement => {
            static RULE: OperandTypeRule = rule(Any, &[PointerTo(0)]);
            &RULE
        }
        Op::AtomicStore => {
            static RULE: OperandTypeRule = rule(Any, &[Any, Any, Any, Pointee(1)]);
            &RULE
        }
        Op::AtomicCompareExchange => {
            static RULE: OperandTypeRule = rule(Any, &[PointerTo(0), Any, Any, Any, SameAs(0), SameAs(0)]);
            &RULE
        }
        Op::AtomicExchange
        | Op::AtomicIAdd
        | Op::AtomicISub
        | Op::AtomicSMin
        | Op::AtomicUMin
        | Op::AtomicSMax
        | Op::AtomicUMax
        | Op::AtomicAnd
        | Op::AtomicOr
        | Op::AtomicXor
        | Op::AtomicFAddEXT
        | Op::AtomicFMinEXT
        | Op::AtomicFMaxEXT => {
            static RULE: OperandTypeRule = rule(Any, &[PointerTo(0), Any, Any, SameAs(0)]);
            &RULE
        }
        _ => return None,
    })
}

/// The rule of an instruction of `GLSL.std.450`.
pub fn glsl(number: u32) -> Option<&'static OperandTypeRule> {
    Some(match G::from_u32(number)? {
        G::Round
        | G::RoundEven
        | G::Trunc
        | G::FAbs
        | G::FSign
        | G::Floor
        | G::Ceil
        | G::Fract
        | G::Radians
        | G::Degrees
        | G::Sin
        | G::Cos
        | G::Tan
        | G::Asin
        | G::Acos
        | G::Atan
        | G::Sinh
        | G::Cosh
        | G::Tanh
        | G::Asinh
        | G::Acosh
        | G::Atanh
        | G::Exp
        | G::Log
        | G::Exp2
        | G::Log2
        | G::Sqrt
        | G::InverseSqrt
        | G::Normalize => &FLOAT_UNARY,
        G::Atan2 | G::Pow | G::FMin | G::FMax | G::NMin | G::NMax | G::Step | G::Reflect => &FLOAT_BINARY,
        G::FClamp | G::NClamp | G::FMix | G::SmoothStep | G::Fma | G::FaceForward => &FLOAT_TERNARY,
        G::SAbs | G::SSign => &INT_UNARY,
        G::UMin | G::SMin | G::UMax | G::SMax => &INT_BINARY,
        G::UClamp | G::SClamp => &INT_TERNARY,
        G::Ldexp => {
            static RULE: OperandTypeRule = rule(OfKind(FLOAT), &[SameAs(0), SameCount(INT, 0)]);
            &RULE
        }
        G::FindILsb | G::FindSMsb | G::FindUMsb => {
            static RULE: OperandTypeRule = rule(Bits(INT, 32), &[SameShape(INT, 0)]);
            &RULE
        }
        G::Length => {
            static RULE: OperandTypeRule = rule(Scalar(FLOAT), &[ScalarOrVectorOf(0)]);
            &RULE
        }
        G::Distance => {
            static RULE: OperandTypeRule = rule(Scalar(FLOAT), &[ScalarOrVectorOf(0), SameAs(1)]);
            &RULE
        }
        G::Cross => {
            static RULE: OperandTypeRule = rule(Vector(FLOAT), &[SameAs(0), SameAs(0)]);
            &RULE
        }
        G::Refract => {
            static RULE: OperandTypeRule = rule(OfKind(FLOAT), &[SameAs(0), SameAs(0), Scalar(FLOAT)]);
            &RULE
        }
        G::MatrixInverse => {
            static RULE: OperandTypeRule = rule(Any, &[SameAs(0)]);
            &RULE
        }
        G::Modf | G::Frexp => {
            static RULE: OperandTypeRule = rule(OfKind(FLOAT), &[SameAs(0), Any]);
            &RULE
        }
        G::ModfStruct => {
            static RULE: OperandTypeRule = rule(Pair(FLOAT), &[MemberOf(0)]);
            &RULE
        }
        G::FrexpStruct => {
            static RULE: OperandTypeRule = rule(Any, &[MemberOf(0)]);
            &RULE
        }
        G::PackSnorm4x8 | G::PackUnorm4x8 => {
            static RULE: OperandTypeRule = rule(ScalarBits(INT, 32), &[VectorBits(FLOAT, 32, 4)]);
            &RULE
        }
        G::PackSnorm2x16 | G::PackUnorm2x16 | G::PackHalf2x16 => {
            static RULE: OperandTypeRule = rule(ScalarBits(INT, 32), &[VectorBits(FLOAT, 32, 2)]);
            &RULE
        }
        G::PackDouble2x32 => {
            static RULE: OperandTypeRule = rule(ScalarBits(FLOAT, 64), &[VectorBits(INT, 32, 2)]);
            &RULE
        }
        G::UnpackSnorm4x8 | G::UnpackUnorm4x8 => {
            static RULE: OperandTypeRule = rule(VectorBits(FLOAT, 32, 4), &[ScalarBits(INT, 32)]);
            &RULE
        }
        G::UnpackSnorm2x16 | G::UnpackUnorm2x16 | G::UnpackHalf2x16 => {
            static RULE: OperandTypeRule = rule(VectorBits(FLOAT, 32, 2), &[ScalarBits(INT, 32)]);
            &RULE
        }
        G::UnpackDouble2x32 => {
            static RULE: OperandTypeRule = rule(VectorBits(INT, 32, 2), &[ScalarBits(FLOAT, 64)]);
            &RULE
        }
        _ => return None,
    })
}
