//! The rules: instructions with operands of the same types share one.

use crate::module::Opcode;
use rspirv::spirv::GlslStd450Op as G;

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

/// An instruction of the core, or of `GLSL.std.450`.
#[derive(Clone, Copy)]
pub(super) enum Numbered {
    Core(Opcode),
    Glsl(u32),
}

/// Whether an instruction that has a rule may have cooperative vectors as operands
/// (`SPV_NV_cooperative_vector`, sections 3.42.11 to 3.42.14).
pub(super) fn takes_cooperative_vectors(instruction: Numbered) -> bool {
    match instruction {
        Numbered::Core(opcode) => matches!(
            opcode,
            Opcode::ConvertFToU
                | Opcode::ConvertFToS
                | Opcode::ConvertSToF
                | Opcode::ConvertUToF
                | Opcode::UConvert
                | Opcode::SConvert
                | Opcode::FConvert
                | Opcode::SNegate
                | Opcode::FNegate
                | Opcode::IAdd
                | Opcode::FAdd
                | Opcode::ISub
                | Opcode::FSub
                | Opcode::FMul
                | Opcode::IMul
                | Opcode::FDiv
                | Opcode::SDiv
                | Opcode::UDiv
                | Opcode::VectorTimesScalar
                | Opcode::ShiftRightLogical
                | Opcode::ShiftRightArithmetic
                | Opcode::ShiftLeftLogical
                | Opcode::BitwiseOr
                | Opcode::BitwiseXor
                | Opcode::BitwiseAnd
                | Opcode::Not
                | Opcode::Select
                | Opcode::CopyObject
                | Opcode::FreezeKHR
                | Opcode::VectorExtractDynamic
                | Opcode::VectorInsertDynamic
        ),
        Numbered::Glsl(number) => matches!(
            G::from_u32(number),
            Some(
                G::FMin
                    | G::UMin
                    | G::SMin
                    | G::NMin
                    | G::FMax
                    | G::UMax
                    | G::SMax
                    | G::NMax
                    | G::FClamp
                    | G::UClamp
                    | G::SClamp
                    | G::NClamp
                    | G::Step
                    | G::Exp
                    | G::Log
                    | G::Tanh
                    | G::Atan
                    | G::Fma
            )
        ),
    }
}

/// Whether an instruction that has a rule may have cooperative matrices as operands
/// (`SPV_KHR_cooperative_matrix`, sections 3.42.11 to 3.42.13).
pub(super) fn takes_cooperative_matrices(instruction: Numbered) -> bool {
    match instruction {
        Numbered::Core(opcode) => matches!(
            opcode,
            Opcode::ConvertFToU
                | Opcode::ConvertFToS
                | Opcode::ConvertSToF
                | Opcode::ConvertUToF
                | Opcode::UConvert
                | Opcode::SConvert
                | Opcode::FConvert
                | Opcode::SNegate
                | Opcode::FNegate
                | Opcode::IAdd
                | Opcode::FAdd
                | Opcode::ISub
                | Opcode::FSub
                | Opcode::FMul
                | Opcode::IMul
                | Opcode::FDiv
                | Opcode::SDiv
                | Opcode::UDiv
                | Opcode::MatrixTimesScalar
                | Opcode::Select
                | Opcode::CopyObject
                | Opcode::FreezeKHR
        ),
        Numbered::Glsl(_) => false,
    }
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
pub fn core(opcode: Opcode) -> Option<&'static OperandTypeRule> {
    Some(match opcode {
        Opcode::FNegate => &FLOAT_UNARY,
        Opcode::FAdd | Opcode::FSub | Opcode::FMul | Opcode::FDiv | Opcode::FRem | Opcode::FMod => {
            &FLOAT_BINARY
        }
        Opcode::FmaKHR => &FLOAT_TERNARY,
        Opcode::UDiv | Opcode::UMod => &UINT_BINARY,
        Opcode::SNegate | Opcode::Not => &INT_UNARY,
        Opcode::IAdd | Opcode::ISub | Opcode::IMul | Opcode::SDiv | Opcode::SMod | Opcode::SRem => {
            &INT_BINARY
        }
        Opcode::BitwiseOr | Opcode::BitwiseXor | Opcode::BitwiseAnd => &INT_BINARY,
        Opcode::IAddCarry | Opcode::ISubBorrow | Opcode::UMulExtended => {
            static RULE: OperandTypeRule = rule(Pair(UINT), &[MemberOf(0), MemberOf(0)]);
            &RULE
        }
        Opcode::SMulExtended => {
            static RULE: OperandTypeRule = rule(Pair(INT), &[MemberOf(0), MemberOf(0)]);
            &RULE
        }
        Opcode::Dot => {
            static RULE: OperandTypeRule = rule(Scalar(FLOAT), &[VectorOf(0), SameAs(1)]);
            &RULE
        }
        Opcode::VectorTimesScalar => {
            static RULE: OperandTypeRule = rule(Vector(FLOAT), &[SameAs(0), ComponentOf(0)]);
            &RULE
        }
        Opcode::MatrixTimesScalar => {
            static RULE: OperandTypeRule = rule(Any, &[SameAs(0), ComponentOf(0)]);
            &RULE
        }
        Opcode::ShiftLeftLogical | Opcode::ShiftRightLogical | Opcode::ShiftRightArithmetic => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameShape(INT, 0), SameCount(INT, 0)]);
            &RULE
        }
        Opcode::BitFieldInsert => {
            static RULE: OperandTypeRule =
                rule(OfKind(INT), &[SameAs(0), SameAs(0), Scalar(INT), Scalar(INT)]);
            &RULE
        }
        Opcode::BitFieldSExtract | Opcode::BitFieldUExtract => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameAs(0), Scalar(INT), Scalar(INT)]);
            &RULE
        }
        Opcode::BitReverse => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameAs(0)]);
            &RULE
        }
        Opcode::BitCount => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameCount(INT, 0)]);
            &RULE
        }
        Opcode::Any | Opcode::All => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Vector(BOOL)]);
            &RULE
        }
        Opcode::IsNan | Opcode::IsInf => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[SameCount(FLOAT, 0)]);
            &RULE
        }
        Opcode::FOrdEqual
        | Opcode::FUnordEqual
        | Opcode::FOrdNotEqual
        | Opcode::FUnordNotEqual
        | Opcode::FOrdLessThan
        | Opcode::FUnordLessThan
        | Opcode::FOrdGreaterThan
        | Opcode::FUnordGreaterThan
        | Opcode::FOrdLessThanEqual
        | Opcode::FUnordLessThanEqual
        | Opcode::FOrdGreaterThanEqual
        | Opcode::FUnordGreaterThanEqual
        | Opcode::LessOrGreater
        | Opcode::Ordered
        | Opcode::Unordered => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[SameCount(FLOAT, 0), SameAs(1)]);
            &RULE
        }
        Opcode::LogicalEqual | Opcode::LogicalNotEqual | Opcode::LogicalOr | Opcode::LogicalAnd => {
            &BOOL_BINARY
        }
        Opcode::LogicalNot => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[SameAs(0)]);
            &RULE
        }
        Opcode::IEqual
        | Opcode::INotEqual
        | Opcode::UGreaterThan
        | Opcode::UGreaterThanEqual
        | Opcode::ULessThan
        | Opcode::ULessThanEqual
        | Opcode::SGreaterThan
        | Opcode::SGreaterThanEqual
        | Opcode::SLessThan
        | Opcode::SLessThanEqual => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[SameCount(INT, 0), SameShape(INT, 1)]);
            &RULE
        }
        Opcode::Select => {
            static RULE: OperandTypeRule = rule(Any, &[Condition(0), SameAs(0), SameAs(0)]);
            &RULE
        }
        Opcode::ConvertFToU => {
            static RULE: OperandTypeRule = rule(OfKind(UINT), &[SameCount(FLOAT, 0)]);
            &RULE
        }
        Opcode::ConvertFToS => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[SameCount(FLOAT, 0)]);
            &RULE
        }
        Opcode::ConvertSToF | Opcode::ConvertUToF => {
            static RULE: OperandTypeRule = rule(OfKind(FLOAT), &[SameCount(INT, 0)]);
            &RULE
        }
        Opcode::UConvert => {
            static RULE: OperandTypeRule = rule(OfKind(UINT), &[OtherWidth(INT, 0)]);
            &RULE
        }
        Opcode::SConvert => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[OtherWidth(INT, 0)]);
            &RULE
        }
        Opcode::FConvert => {
            static RULE: OperandTypeRule = rule(OfKind(FLOAT), &[OtherWidth(FLOAT, 0)]);
            &RULE
        }
        Opcode::QuantizeToF16 => {
            static RULE: OperandTypeRule = rule(Bits(FLOAT, 32), &[SameAs(0)]);
            &RULE
        }
        Opcode::SatConvertSToU => &INT_UNARY,
        // 64 bits need a capability, which the translation checks.
        Opcode::ArrayLength | Opcode::UntypedArrayLengthKHR => {
            static RULE: OperandTypeRule = rule(Scalar(UINT), &[]);
            &RULE
        }
        // Typed pointers are of one type, which the translation checks.
        Opcode::PtrEqual | Opcode::PtrNotEqual => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, Any]);
            &RULE
        }
        Opcode::PtrDiff => {
            static RULE: OperandTypeRule = rule(Scalar(INT), &[Any, SameAs(1)]);
            &RULE
        }
        Opcode::ConvertPtrToU => {
            static RULE: OperandTypeRule = rule(Scalar(UINT), &[]);
            &RULE
        }
        Opcode::ConvertUToPtr => {
            static RULE: OperandTypeRule = rule(Any, &[Scalar(INT)]);
            &RULE
        }
        Opcode::ImageGather | Opcode::ImageSparseGather => {
            static RULE: OperandTypeRule = rule(Any, &[Any, Any, ScalarBits(INT, 32)]);
            &RULE
        }
        Opcode::ImageSampleDrefImplicitLod
        | Opcode::ImageSampleDrefExplicitLod
        | Opcode::ImageSampleProjDrefImplicitLod
        | Opcode::ImageSampleProjDrefExplicitLod
        | Opcode::ImageSparseSampleDrefImplicitLod
        | Opcode::ImageSparseSampleDrefExplicitLod
        | Opcode::ImageDrefGather
        | Opcode::ImageSparseDrefGather => {
            static RULE: OperandTypeRule = rule(Any, &[Any, Any, ScalarBits(FLOAT, 32)]);
            &RULE
        }
        Opcode::CopyObject | Opcode::FreezeKHR => {
            static RULE: OperandTypeRule = rule(Any, &[SameAs(0)]);
            &RULE
        }
        Opcode::VectorExtractDynamic => {
            static RULE: OperandTypeRule = rule(OfKind(SCALAR), &[VectorOf(0), Scalar(INT)]);
            &RULE
        }
        Opcode::VectorInsertDynamic => {
            static RULE: OperandTypeRule = rule(Vector(SCALAR), &[SameAs(0), ComponentOf(0), Scalar(INT)]);
            &RULE
        }
        Opcode::ExpectKHR => {
            static RULE: OperandTypeRule = rule(OfKind(INT | BOOL), &[SameAs(0), SameAs(0)]);
            &RULE
        }
        Opcode::Switch => {
            static RULE: OperandTypeRule = rule(Any, &[Scalar(INT)]);
            &RULE
        }
        Opcode::AssumeTrueKHR | Opcode::BranchConditional => {
            static RULE: OperandTypeRule = rule(Any, &[Scalar(BOOL)]);
            &RULE
        }
        Opcode::UCountLeadingZerosINTEL | Opcode::UCountTrailingZerosINTEL => &INT_UNARY,
        Opcode::AbsISubINTEL
        | Opcode::AbsUSubINTEL
        | Opcode::IAddSatINTEL
        | Opcode::UAddSatINTEL
        | Opcode::ISubSatINTEL
        | Opcode::USubSatINTEL
        | Opcode::IAverageINTEL
        | Opcode::UAverageINTEL
        | Opcode::IAverageRoundedINTEL
        | Opcode::UAverageRoundedINTEL => &INT_BINARY,
        Opcode::IMul32x16INTEL | Opcode::UMul32x16INTEL => {
            static RULE: OperandTypeRule = rule(Bits(INT, 32), &[SameShape(INT, 0), SameShape(INT, 0)]);
            &RULE
        }
        op => return subgroup(op).or_else(|| atomic(op)),
    })
}

/// The rule of a subgroup instruction, whose first operand is a scope.
fn subgroup(op: Opcode) -> Option<&'static OperandTypeRule> {
    Some(match op {
        Opcode::GroupNonUniformAll | Opcode::GroupNonUniformAny => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, Scalar(BOOL)]);
            &RULE
        }
        Opcode::GroupNonUniformAllEqual => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, OfKind(SCALAR)]);
            &RULE
        }
        Opcode::GroupNonUniformBroadcastFirst => {
            static RULE: OperandTypeRule = rule(OfKind(SCALAR), &[Any, SameAs(0)]);
            &RULE
        }
        Opcode::GroupNonUniformBroadcast
        | Opcode::GroupNonUniformShuffle
        | Opcode::GroupNonUniformShuffleXor
        | Opcode::GroupNonUniformShuffleUp
        | Opcode::GroupNonUniformShuffleDown
        | Opcode::GroupNonUniformRotateKHR
        | Opcode::GroupNonUniformQuadBroadcast
        | Opcode::GroupNonUniformQuadSwap => {
            static RULE: OperandTypeRule = rule(OfKind(SCALAR), &[Any, SameAs(0), Scalar(UINT)]);
            &RULE
        }
        Opcode::GroupNonUniformBallot => {
            static RULE: OperandTypeRule = rule(VectorBits(UINT, 32, 4), &[Any, Scalar(BOOL)]);
            &RULE
        }
        Opcode::GroupNonUniformInverseBallot => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, VectorBits(UINT, 32, 4)]);
            &RULE
        }
        Opcode::GroupNonUniformBallotBitExtract => {
            static RULE: OperandTypeRule = rule(Scalar(BOOL), &[Any, VectorBits(UINT, 32, 4), Scalar(UINT)]);
            &RULE
        }
        Opcode::GroupNonUniformBallotBitCount => {
            static RULE: OperandTypeRule = rule(Scalar(UINT), &[Any, Any, VectorBits(UINT, 32, 4)]);
            &RULE
        }
        Opcode::GroupNonUniformBallotFindLSB | Opcode::GroupNonUniformBallotFindMSB => {
            static RULE: OperandTypeRule = rule(Scalar(UINT), &[Any, VectorBits(UINT, 32, 4)]);
            &RULE
        }
        Opcode::GroupNonUniformIAdd
        | Opcode::GroupNonUniformIMul
        | Opcode::GroupNonUniformSMin
        | Opcode::GroupNonUniformSMax
        | Opcode::GroupNonUniformBitwiseAnd
        | Opcode::GroupNonUniformBitwiseOr
        | Opcode::GroupNonUniformBitwiseXor => {
            static RULE: OperandTypeRule = rule(OfKind(INT), &[Any, Any, SameAs(0)]);
            &RULE
        }
        Opcode::GroupNonUniformUMin | Opcode::GroupNonUniformUMax => {
            static RULE: OperandTypeRule = rule(OfKind(UINT), &[Any, Any, SameAs(0)]);
            &RULE
        }
        Opcode::GroupNonUniformFAdd
        | Opcode::GroupNonUniformFMul
        | Opcode::GroupNonUniformFMin
        | Opcode::GroupNonUniformFMax => {
            static RULE: OperandTypeRule = rule(OfKind(FLOAT), &[Any, Any, SameAs(0)]);
            &RULE
        }
        Opcode::GroupNonUniformLogicalAnd
        | Opcode::GroupNonUniformLogicalOr
        | Opcode::GroupNonUniformLogicalXor => {
            static RULE: OperandTypeRule = rule(OfKind(BOOL), &[Any, Any, SameAs(0)]);
            &RULE
        }
        _ => return None,
    })
}

/// The rule of an atomic instruction: the pointer is followed by scope and semantics, two for a
/// comparison.
fn atomic(op: Opcode) -> Option<&'static OperandTypeRule> {
    Some(match op {
        Opcode::AtomicLoad | Opcode::AtomicIIncrement | Opcode::AtomicIDecrement => {
            static RULE: OperandTypeRule = rule(Any, &[PointerTo(0)]);
            &RULE
        }
        Opcode::AtomicStore => {
            static RULE: OperandTypeRule = rule(Any, &[Any, Any, Any, Pointee(1)]);
            &RULE
        }
        Opcode::AtomicCompareExchange => {
            static RULE: OperandTypeRule = rule(Any, &[PointerTo(0), Any, Any, Any, SameAs(0), SameAs(0)]);
            &RULE
        }
        Opcode::AtomicExchange
        | Opcode::AtomicIAdd
        | Opcode::AtomicISub
        | Opcode::AtomicSMin
        | Opcode::AtomicUMin
        | Opcode::AtomicSMax
        | Opcode::AtomicUMax
        | Opcode::AtomicAnd
        | Opcode::AtomicOr
        | Opcode::AtomicXor
        | Opcode::AtomicFAddEXT
        | Opcode::AtomicFMinEXT
        | Opcode::AtomicFMaxEXT => {
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
