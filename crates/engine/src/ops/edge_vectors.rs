//! Every kernel at its edges: signed zeros, denormals, infinities and NaN, the least and the
//! greatest integers, shifts by one less than the width. Derived by hand from IEEE 754-2019 (9.2.1
//! for elementary functions), the SPIR-V specification, and what this project declares where those
//! leave a result open.

use crate::ops::SECTIONS;
use crate::ops::lane_kernel::OpFamily;
use crate::ops::lane_kernel::tests::{check, results};

/// Negative zero.
const NEG_ZERO: u64 = 0x8000_0000;
/// 1, -1, 2, 1/2
const ONE: u64 = 0x3F80_0000;
const NEG_ONE: u64 = 0xBF80_0000;
const TWO: u64 = 0x4000_0000;
const HALF: u64 = 0x3F00_0000;
/// 2^-149, the smallest number, and its negative.
const MIN_DENORMAL: u64 = 1;
const NEG_MIN_DENORMAL: u64 = 0x8000_0001;
/// 2^-126, the smallest normal number, and the denormal below it.
const MIN_NORMAL: u64 = 0x0080_0000;
const MAX_DENORMAL: u64 = 0x007F_FFFF;
/// (2 - 2^-23) 2^127
const MAX: u64 = 0x7F7F_FFFF;
const NEG_MAX: u64 = 0xFF7F_FFFF;
const INF: u64 = 0x7F80_0000;
const NEG_INF: u64 = 0xFF80_0000;
const NAN: u64 = 0x7FC0_0000;
/// The least and the greatest int.
const INT_MIN: u64 = 0x8000_0000;
const INT_MAX: u64 = 0x7FFF_FFFF;
const UINT_MAX: u64 = 0xFFFF_FFFF;
/// pi, pi/2, pi/4, 3 pi/4, rounded.
const PI: u64 = 0x4049_0FDB;
const PI_2: u64 = 0x3FC9_0FDB;
const PI_4: u64 = 0x3F49_0FDB;
const PI_3_4: u64 = 0x4016_CBE4;

type Vector = (&'static str, u32, &'static [u64], u64);

/// Vectors of integer kernels: name, width, operands, result.
const INTEGERS: &[Vector] = &[
    ("SNegate", 8, &[0x80], 0x80),
    ("SNegate", 64, &[1 << 63], 1 << 63),
    ("IAdd", 16, &[0xFFFF, 1], 0),
    ("IAdd", 64, &[u64::MAX, 1], 0),
    ("ISub", 32, &[INT_MIN, 1], INT_MAX),
    ("ISub", 64, &[0, 1], u64::MAX),
    ("IMul", 32, &[UINT_MAX, UINT_MAX], 1),
    ("IMul", 8, &[0x80, 0x80], 0),
    ("UDiv", 64, &[u64::MAX, u64::MAX], 1),
    ("UDiv", 8, &[0xFF, 0], 0xFF),
    // -2^63 / -1 does not fit and wraps around.
    ("SDiv", 64, &[1 << 63, u64::MAX], 1 << 63),
    ("SDiv", 8, &[0x80, 2], 0xC0),
    ("UMod", 32, &[UINT_MAX, INT_MIN], INT_MAX),
    ("UMod", 16, &[0xFFFF, 0], 0xFFFF),
    ("SRem", 32, &[INT_MIN, UINT_MAX], 0),
    // -2^31 = -715827882 * 3 - 2
    ("SRem", 32, &[INT_MIN, 3], UINT_MAX - 1),
    ("SRem", 64, &[7, 0], 7),
    ("SMod", 32, &[INT_MIN, UINT_MAX], 0),
    ("SMod", 32, &[INT_MIN, 3], 1),
    ("SMod", 32, &[INT_MAX, INT_MIN], UINT_MAX),
    ("ShiftRightLogical", 32, &[UINT_MAX, 31], 1),
    ("ShiftRightLogical", 64, &[u64::MAX, 63], 1),
    ("ShiftRightLogical", 32, &[UINT_MAX, 32], 0),
    ("ShiftRightArithmetic", 32, &[INT_MIN, 31], UINT_MAX),
    ("ShiftRightArithmetic", 64, &[1 << 63, 63], u64::MAX),
    ("ShiftRightArithmetic", 16, &[0x7FFF, 15], 0),
    ("ShiftLeftLogical", 64, &[3, 63], 1 << 63),
    ("ShiftLeftLogical", 8, &[0xFF, 7], 0x80),
    ("BitwiseOr", 64, &[1 << 63, 1], 1 << 63 | 1),
    ("BitwiseXor", 32, &[UINT_MAX, INT_MIN], INT_MAX),
    ("BitwiseXor", 64, &[u64::MAX, u64::MAX], 0),
    ("BitwiseAnd", 64, &[u64::MAX, 1 << 63], 1 << 63),
    ("Not", 64, &[0], u64::MAX),
    ("Not", 8, &[0x80], 0x7F),
    ("BitReverse", 64, &[1], 1 << 63),
    ("BitReverse", 8, &[0x01], 0x80),
    ("BitCount", 8, &[0xFF], 8),
    ("BitCount", 32, &[0], 0),
    ("SatConvertSToU", 32, &[INT_MIN], 0),
    ("SatConvertSToU", 64, &[i64::MAX as u64], i64::MAX as u64),
    ("SAbs", 64, &[1 << 63], 1 << 63),
    ("SAbs", 16, &[0xFFFF], 1),
    ("SSign", 32, &[INT_MIN], UINT_MAX),
    ("SSign", 64, &[0], 0),
    ("UMin", 32, &[UINT_MAX, 0], 0),
    ("UMin", 64, &[u64::MAX, 1 << 63], 1 << 63),
    ("UMax", 32, &[UINT_MAX, 0], UINT_MAX),
    ("UMax", 8, &[0x7F, 0x80], 0x80),
    ("SMin", 32, &[INT_MIN, INT_MAX], INT_MIN),
    ("SMin", 64, &[0, u64::MAX], u64::MAX),
    ("SMax", 32, &[INT_MIN, INT_MAX], INT_MAX),
    ("SMax", 8, &[0x80, 0xFF], 0xFF),
    ("UClamp", 32, &[UINT_MAX, 1, INT_MIN], INT_MIN),
    ("UClamp", 64, &[0, 1, u64::MAX], 1),
    ("SClamp", 32, &[INT_MIN, UINT_MAX, 1], UINT_MAX),
    ("SClamp", 64, &[i64::MAX as u64, u64::MAX, 1], 1),
    ("FindILsb", 32, &[INT_MIN], 31),
    ("FindILsb", 32, &[0], UINT_MAX),
    ("FindUMsb", 32, &[UINT_MAX], 31),
    ("FindUMsb", 32, &[0], UINT_MAX),
    // For a negative number, the highest 0 is found; for -1 and 0, nothing is.
    ("FindSMsb", 32, &[INT_MIN], 30),
    ("FindSMsb", 32, &[0], UINT_MAX),
    ("UCountLeadingZerosINTEL", 64, &[1], 63),
    ("UCountLeadingZerosINTEL", 16, &[0x8000], 0),
    ("UCountTrailingZerosINTEL", 32, &[0], 32),
    ("UCountTrailingZerosINTEL", 64, &[1 << 63], 63),
    ("AbsISubINTEL", 64, &[1 << 63, i64::MAX as u64], u64::MAX),
    ("AbsUSubINTEL", 64, &[0, u64::MAX], u64::MAX),
    ("IAddSatINTEL", 32, &[INT_MIN, UINT_MAX], INT_MIN),
    ("IAddSatINTEL", 64, &[i64::MAX as u64, 1], i64::MAX as u64),
    ("UAddSatINTEL", 8, &[0xFF, 0xFF], 0xFF),
    ("ISubSatINTEL", 32, &[INT_MAX, UINT_MAX], INT_MAX),
    ("ISubSatINTEL", 64, &[1 << 63, 1], 1 << 63),
    ("USubSatINTEL", 32, &[0, UINT_MAX], 0),
    ("IAverageINTEL", 32, &[INT_MIN, INT_MIN], INT_MIN),
    ("IAverageINTEL", 64, &[1 << 63, i64::MAX as u64], u64::MAX),
    ("UAverageINTEL", 64, &[u64::MAX, u64::MAX], u64::MAX),
    ("IAverageRoundedINTEL", 64, &[1 << 63, i64::MAX as u64], 0),
    ("UAverageRoundedINTEL", 8, &[0xFF, 0], 0x80),
    // The lower half of the second operand: -2^15.
    ("IMul32x16INTEL", 32, &[INT_MIN, 0x8000], 0),
    ("IMul32x16INTEL", 32, &[UINT_MAX, 0x8000], 0x8000),
    ("UMul32x16INTEL", 32, &[UINT_MAX, 0xFFFF], 0xFFFF_0001),
    ("LogicalEqual", 0, &[0, 0], 1),
    ("LogicalEqual", 0, &[0, 1], 0),
    ("LogicalNotEqual", 0, &[1, 0], 1),
    ("LogicalNotEqual", 0, &[1, 1], 0),
    ("LogicalOr", 0, &[0, 1], 1),
    ("LogicalOr", 0, &[0, 0], 0),
    ("LogicalAnd", 0, &[1, 0], 0),
    ("LogicalAnd", 0, &[1, 1], 1),
    ("LogicalNot", 0, &[0], 1),
    ("IEqual", 64, &[u64::MAX, UINT_MAX], 0),
    ("IEqual", 8, &[0x80, 0x80], 1),
    ("INotEqual", 64, &[1 << 63, 0], 1),
    ("UGreaterThan", 32, &[INT_MIN, INT_MAX], 1),
    ("UGreaterThan", 64, &[u64::MAX, u64::MAX], 0),
    ("SGreaterThan", 32, &[INT_MIN, INT_MAX], 0),
    ("UGreaterThanEqual", 64, &[1 << 63, i64::MAX as u64], 1),
    ("UGreaterThanEqual", 8, &[0x7F, 0x80], 0),
    ("SGreaterThanEqual", 64, &[1 << 63, 1 << 63], 1),
    ("SGreaterThanEqual", 8, &[0x80, 0x7F], 0),
    ("ULessThan", 64, &[i64::MAX as u64, 1 << 63], 1),
    ("SLessThan", 64, &[1 << 63, i64::MAX as u64], 1),
    ("ULessThanEqual", 32, &[UINT_MAX, UINT_MAX], 1),
    ("ULessThanEqual", 64, &[u64::MAX, 0], 0),
    ("SLessThanEqual", 32, &[UINT_MAX, 0], 1),
    ("SLessThanEqual", 16, &[0, 0x8000], 0),
];

const ARITHMETIC: &[Vector] = &[
    ("FNegate", 32, &[NEG_ZERO], 0),
    ("FNegate", 64, &[0], 1 << 63),
    ("FNegate", 16, &[0x7C00], 0xFC00),
    // Zeros of unlike sign add up to +0.
    ("FAdd", 32, &[NEG_ZERO, NEG_ZERO], NEG_ZERO),
    ("FAdd", 32, &[NEG_ZERO, 0], 0),
    ("FAdd", 32, &[MAX_DENORMAL, MIN_DENORMAL], MIN_NORMAL),
    ("FAdd", 32, &[MAX, MAX], INF),
    ("FAdd", 16, &[0x7BFF, 0x4C00], 0x7C00), // 65504 + 16 is the tie to 2^16
    ("FSub", 32, &[NEG_ZERO, 0], NEG_ZERO),
    ("FSub", 32, &[ONE, ONE], 0),
    ("FSub", 32, &[MIN_NORMAL, MIN_DENORMAL], MAX_DENORMAL),
    ("FSub", 64, &[0, 0], 0),
    ("FMul", 32, &[NEG_ZERO, ONE], NEG_ZERO),
    ("FMul", 32, &[MIN_DENORMAL, HALF], 0), // 2^-150 is a tie, to even
    ("FMul", 32, &[0x0000_0003, HALF], 2),  // 1.5 units: to even
    ("FMul", 32, &[MAX, TWO], INF),
    ("FDiv", 32, &[ONE, NEG_ZERO], NEG_INF),
    ("FDiv", 32, &[ONE, INF], 0),
    ("FDiv", 32, &[MIN_NORMAL, TWO], 0x0040_0000),
    ("FDiv", 32, &[MAX, HALF], INF),
    ("FDiv", 64, &[0x3FF0_0000_0000_0000, 0x7FF0_0000_0000_0000], 0),
    ("FRem", 32, &[MIN_DENORMAL, ONE], MIN_DENORMAL),
    // trunc(-0 / 1) = -0, 1 * -0 = -0, -0 - -0 = +0
    ("FRem", 32, &[NEG_ZERO, ONE], 0),
    ("FMod", 32, &[NEG_ONE, TWO], ONE),
    ("FMod", 32, &[NEG_MIN_DENORMAL, ONE], ONE), // floor(-2^-149) = -1, -2^-149 + 1 rounds to 1
    ("FmaKHR", 32, &[NEG_ZERO, ONE, NEG_ZERO], NEG_ZERO),
    ("FmaKHR", 32, &[MIN_DENORMAL, MIN_DENORMAL, 0], 0),
    ("FmaKHR", 32, &[MAX, TWO, NEG_INF], NEG_INF),
    ("QuantizeToF16", 32, &[INF], INF),
    ("QuantizeToF16", 32, &[NEG_ZERO], NEG_ZERO),
    ("QuantizeToF16", 32, &[0x477F_F000], INF),         // 65520
    ("QuantizeToF16", 32, &[0x477F_EFFF], 0x477F_E000), // below it: 65504
    ("QuantizeToF16", 32, &[0x3880_0000], 0x3880_0000), // 2^-14
    ("IsNan", 32, &[0x7F80_0001], 1),
    ("IsNan", 32, &[INF], 0),
    ("IsInf", 32, &[NEG_INF], 1),
    ("IsInf", 32, &[NAN], 0),
    ("IsInf", 16, &[0x7BFF], 0),
    ("FOrdEqual", 64, &[0, 1 << 63], 1),
    ("FOrdEqual", 32, &[INF, INF], 1),
    ("FUnordEqual", 32, &[0, NEG_ZERO], 1),
    ("FUnordEqual", 32, &[MIN_DENORMAL, 0], 0),
    ("FOrdNotEqual", 32, &[0, NEG_ZERO], 0),
    ("FOrdNotEqual", 32, &[MIN_DENORMAL, NEG_MIN_DENORMAL], 1),
    ("FUnordNotEqual", 32, &[NEG_ZERO, 0], 0),
    ("FUnordNotEqual", 32, &[NAN, INF], 1),
    ("FOrdLessThan", 32, &[NEG_ZERO, 0], 0),
    ("FOrdLessThan", 32, &[NEG_MIN_DENORMAL, NEG_ZERO], 1),
    ("FUnordLessThan", 32, &[NEG_ZERO, 0], 0),
    ("FUnordLessThan", 32, &[NEG_INF, NAN], 1),
    ("FOrdGreaterThan", 32, &[MIN_DENORMAL, 0], 1),
    ("FOrdGreaterThan", 32, &[INF, NAN], 0),
    ("FOrdGreaterThan", 32, &[0, NEG_ZERO], 0),
    ("FUnordGreaterThan", 32, &[NAN, INF], 1),
    ("FUnordGreaterThan", 32, &[INF, INF], 0),
    ("FOrdLessThanEqual", 32, &[0, NEG_ZERO], 1),
    ("FOrdLessThanEqual", 32, &[NAN, NAN], 0),
    ("FOrdLessThanEqual", 32, &[INF, MAX], 0),
    ("FUnordLessThanEqual", 32, &[0, NEG_ZERO], 1),
    ("FUnordLessThanEqual", 32, &[ONE, NAN], 1),
    ("FUnordLessThanEqual", 32, &[MIN_DENORMAL, 0], 0),
    ("FOrdGreaterThanEqual", 32, &[NEG_ZERO, 0], 1),
    ("FOrdGreaterThanEqual", 32, &[NAN, NEG_INF], 0),
    ("FOrdGreaterThanEqual", 32, &[NEG_INF, NEG_MAX], 0),
    ("FUnordGreaterThanEqual", 32, &[NEG_ZERO, 0], 1),
    ("FUnordGreaterThanEqual", 32, &[NAN, INF], 1),
    ("FUnordGreaterThanEqual", 32, &[NEG_MIN_DENORMAL, NEG_ZERO], 0),
    ("Ordered", 32, &[INF, NEG_INF], 1),
    ("Ordered", 64, &[0x7FF8_0000_0000_0000, 0], 0),
    ("Unordered", 32, &[INF, NEG_ZERO], 0),
    ("Unordered", 16, &[0, 0x7C01], 1),
    ("LessOrGreater", 32, &[0, NEG_ZERO], 0),
    ("LessOrGreater", 32, &[NEG_INF, INF], 1),
    ("LessOrGreater", 32, &[NAN, ONE], 0),
];

const FUNCTIONS: &[Vector] = &[
    // 2^23 - 1/2 is a tie; away from zero. The number below 1/2 is no tie.
    ("Round", 32, &[0x4AFF_FFFF], 0x4B00_0000),
    ("Round", 32, &[0x3EFF_FFFF], 0),
    ("Round", 32, &[NEG_MIN_DENORMAL], NEG_ZERO),
    ("Round", 32, &[NEG_INF], NEG_INF),
    ("RoundEven", 32, &[HALF], 0),
    ("RoundEven", 32, &[0xBF00_0000], NEG_ZERO),
    ("RoundEven", 32, &[0x4AFF_FFFF], 0x4B00_0000),
    ("Trunc", 32, &[0xBF7F_FFFF], NEG_ZERO),
    ("Trunc", 32, &[MAX], MAX),
    ("FAbs", 32, &[NEG_INF], INF),
    ("FAbs", 16, &[0x8001], 1),
    ("FSign", 32, &[NEG_MIN_DENORMAL], NEG_ONE),
    ("FSign", 32, &[INF], ONE),
    ("FSign", 32, &[NEG_ZERO], NEG_ZERO),
    ("Floor", 32, &[NEG_ZERO], NEG_ZERO),
    ("Floor", 32, &[NEG_MIN_DENORMAL], NEG_ONE),
    ("Floor", 32, &[NEG_MAX], NEG_MAX),
    ("Ceil", 32, &[MIN_DENORMAL], ONE),
    ("Ceil", 32, &[NEG_MIN_DENORMAL], NEG_ZERO),
    ("Ceil", 64, &[0x8000_0000_0000_0001], 1 << 63),
    // x - floor(x), rounded: just below 0 this is 1.
    ("Fract", 32, &[NEG_MIN_DENORMAL], ONE),
    ("Fract", 32, &[NEG_ZERO], 0),
    ("Fract", 32, &[MIN_DENORMAL], MIN_DENORMAL),
    ("Radians", 32, &[NEG_ZERO], NEG_ZERO),
    ("Radians", 32, &[ONE], 0x3C8E_FA35),
    ("Radians", 32, &[INF], INF),
    ("Degrees", 32, &[NEG_ZERO], NEG_ZERO),
    ("Degrees", 32, &[ONE], 0x4265_2EE1),
    ("Degrees", 32, &[MAX], INF),
    ("Sin", 32, &[NEG_ZERO], NEG_ZERO),
    ("Sin", 32, &[NEG_MIN_DENORMAL], NEG_MIN_DENORMAL),
    ("Cos", 32, &[MAX_DENORMAL], ONE),
    ("Cos", 32, &[NEG_ZERO], ONE),
    ("Tan", 32, &[NEG_ZERO], NEG_ZERO),
    ("Tan", 32, &[MIN_DENORMAL], MIN_DENORMAL),
    ("Asin", 32, &[ONE], PI_2),
    ("Asin", 32, &[NEG_ZERO], NEG_ZERO),
    ("Asin", 32, &[MAX_DENORMAL], MAX_DENORMAL),
    ("Acos", 32, &[ONE], 0),
    ("Acos", 32, &[NEG_ONE], PI),
    ("Acos", 32, &[NEG_MIN_DENORMAL], PI_2),
    ("Atan", 32, &[NEG_INF], PI_2 | NEG_ZERO),
    ("Atan", 32, &[NEG_ZERO], NEG_ZERO),
    ("Atan", 32, &[MIN_DENORMAL], MIN_DENORMAL),
    ("Sinh", 32, &[NEG_ZERO], NEG_ZERO),
    ("Sinh", 32, &[NEG_INF], NEG_INF),
    ("Sinh", 16, &[0x8000], 0x8000),
    ("Sinh", 64, &[1 << 63], 1 << 63),
    ("Sinh", 32, &[MAX], INF),
    ("Cosh", 32, &[NEG_INF], INF),
    ("Cosh", 32, &[NEG_ZERO], ONE),
    ("Tanh", 32, &[NEG_INF], NEG_ONE),
    ("Tanh", 32, &[NEG_ZERO], NEG_ZERO),
    ("Tanh", 32, &[NEG_MIN_DENORMAL], NEG_MIN_DENORMAL),
    ("Asinh", 32, &[NEG_INF], NEG_INF),
    ("Asinh", 32, &[NEG_ZERO], NEG_ZERO),
    ("Acosh", 32, &[ONE], 0),
    ("Acosh", 32, &[INF], INF),
    ("Atanh", 32, &[ONE], INF),
    ("Atanh", 32, &[NEG_ONE], NEG_INF),
    ("Atanh", 32, &[NEG_ZERO], NEG_ZERO),
    ("Atan2", 32, &[NEG_ZERO, NEG_ONE], PI | NEG_ZERO),
    ("Atan2", 32, &[NEG_ZERO, ONE], NEG_ZERO),
    ("Atan2", 32, &[0, NEG_ZERO], PI),
    ("Atan2", 32, &[INF, INF], PI_4),
    ("Atan2", 32, &[NEG_INF, NEG_INF], PI_3_4 | NEG_ZERO),
    ("Atan2", 32, &[MIN_DENORMAL, 0], PI_2),
    ("Atan2", 32, &[ONE, INF], 0),
    ("Pow", 32, &[TWO, 0xC315_0000], MIN_DENORMAL), // 2^-149
    ("Pow", 32, &[TWO, 0x4300_0000], INF),          // 2^128
    ("Pow", 32, &[INF, NEG_ONE], 0),
    ("Pow", 32, &[0, ONE], 0),
    ("Pow", 32, &[NEG_ZERO, 0x4040_0000], NEG_ZERO), // (-0)^3
    ("Pow", 32, &[ONE, MAX], ONE),
    ("Exp", 32, &[NEG_INF], 0),
    ("Exp", 32, &[NEG_ZERO], ONE),
    // e^-104 is 0.48 of 2^-149, e^-103 1.32 of it.
    ("Exp", 32, &[0xC2D0_0000], 0),
    ("Exp", 32, &[0xC2CE_0000], MIN_DENORMAL),
    ("Exp", 32, &[0x42B2_0000], INF), // e^89 > 2^128
    ("Log", 32, &[0], NEG_INF),
    ("Log", 32, &[ONE], 0),
    ("Log", 32, &[INF], INF),
    // -149 ln 2 = -103.27892990...
    ("Log", 32, &[MIN_DENORMAL], 0xC2CE_8ED0),
    ("Exp2", 32, &[0xC316_0000], 0), // 2^-150 is a tie
    ("Exp2", 32, &[0x4300_0000], INF),
    ("Exp2", 32, &[0xC2FC_0000], MIN_NORMAL),
    ("Exp2", 32, &[MIN_DENORMAL], ONE),
    ("Log2", 32, &[MIN_DENORMAL], 0xC315_0000),
    ("Log2", 32, &[NEG_ZERO], NEG_INF),
    ("Log2", 32, &[MIN_NORMAL], 0xC2FC_0000),
    ("Sqrt", 32, &[NEG_ZERO], NEG_ZERO),
    ("Sqrt", 32, &[INF], INF),
    // sqrt(2^-149) = sqrt(2) 2^-75
    ("Sqrt", 32, &[MIN_DENORMAL], 0x1A35_04F3),
    ("InverseSqrt", 32, &[0], INF),
    ("InverseSqrt", 32, &[INF], 0),
    // 1 / sqrt(2^-148) = 2^74
    ("InverseSqrt", 32, &[2], 0x6480_0000),
    // y < x ? y : x: the first one of equal zeros, and of a NaN.
    ("FMin", 32, &[0, NEG_ZERO], 0),
    ("FMin", 32, &[NEG_ZERO, 0], NEG_ZERO),
    ("FMin", 32, &[NEG_INF, MIN_DENORMAL], NEG_INF),
    ("FMax", 32, &[0, NEG_ZERO], 0),
    ("FMax", 32, &[NEG_ZERO, 0], NEG_ZERO),
    ("FMax", 32, &[ONE, NAN], ONE),
    ("FMax", 32, &[NEG_MIN_DENORMAL, NEG_INF], NEG_MIN_DENORMAL),
    ("FClamp", 32, &[INF, NEG_ZERO, ONE], ONE),
    ("FClamp", 32, &[NEG_MIN_DENORMAL, 0, ONE], 0),
    ("FClamp", 32, &[NEG_ZERO, 0, ONE], NEG_ZERO),
    ("NMin", 32, &[NAN, INF], INF),
    ("NMin", 32, &[NEG_INF, NAN], NEG_INF),
    ("NMax", 32, &[NAN, NEG_INF], NEG_INF),
    ("NMax", 32, &[MIN_DENORMAL, NAN], MIN_DENORMAL),
    ("NClamp", 32, &[NAN, MIN_DENORMAL, ONE], MIN_DENORMAL),
    ("NClamp", 32, &[INF, MIN_DENORMAL, ONE], ONE),
    ("NClamp", 32, &[NEG_INF, NEG_ZERO, ONE], NEG_ZERO),
    // x (1 - a) + y a
    ("FMix", 32, &[NEG_ZERO, NEG_ZERO, HALF], NEG_ZERO),
    ("FMix", 32, &[MAX, MAX, HALF], MAX),
    ("FMix", 32, &[ONE, TWO, 0x3EAA_AAAB], 0x3FAA_AAAA),
    ("Step", 32, &[0, NEG_ZERO], ONE),
    ("Step", 32, &[MIN_DENORMAL, 0], 0),
    ("Step", 32, &[NEG_INF, NEG_INF], ONE),
    ("SmoothStep", 32, &[0, ONE, NEG_ZERO], 0),
    ("SmoothStep", 32, &[0, ONE, INF], ONE),
    ("SmoothStep", 32, &[0, ONE, NEG_INF], 0),
    ("Fma", 32, &[NEG_ZERO, ONE, NEG_ZERO], NEG_ZERO),
    ("Fma", 32, &[MAX, TWO, NEG_MAX], INF), // the product is rounded by itself
    ("Ldexp", 32, &[ONE, 0xFFFF_FF6B], MIN_DENORMAL), // -149
    ("Ldexp", 32, &[ONE, 0xFFFF_FF6A], 0),  // 2^-150 is a tie
    ("Ldexp", 32, &[NEG_ZERO, INT_MAX], NEG_ZERO),
    ("Ldexp", 32, &[NEG_INF, INT_MIN], NEG_INF),
    ("Ldexp", 32, &[MIN_DENORMAL, 276], 0x7F00_0000), // 2^127
    ("Ldexp", 32, &[MIN_DENORMAL, 277], INF),
];

/// Kernels whose result is a NaN.
const NANS: &[(&str, u32, &[u64])] = &[
    ("FAdd", 32, &[INF, NEG_INF]),
    ("FSub", 32, &[INF, INF]),
    ("FMul", 32, &[0, NEG_INF]),
    ("FDiv", 32, &[0, NEG_ZERO]),
    ("FDiv", 64, &[0, 0]),
    ("FRem", 32, &[ONE, 0]),
    // trunc(1 / inf) = 0, inf * 0 is a NaN.
    ("FRem", 32, &[ONE, INF]),
    ("FMod", 32, &[INF, ONE]),
    ("FmaKHR", 32, &[INF, 0, ONE]),
    ("Fma", 32, &[INF, ONE, NEG_INF]),
    ("QuantizeToF16", 32, &[NAN]),
    ("Round", 32, &[NAN]),
    ("RoundEven", 32, &[NAN]),
    ("Trunc", 32, &[NAN]),
    ("Floor", 32, &[NAN]),
    ("Ceil", 32, &[NAN]),
    ("FSign", 32, &[NAN]),
    ("Fract", 32, &[INF]),
    ("Sin", 32, &[INF]),
    ("Cos", 32, &[NEG_INF]),
    ("Tan", 32, &[INF]),
    ("Asin", 32, &[0x3F80_0001]),
    ("Acos", 32, &[INF]),
    ("Atan", 32, &[NAN]),
    ("Acosh", 32, &[0x3F7F_FFFF]),
    ("Atanh", 32, &[0x3F80_0001]),
    ("Sinh", 32, &[NAN]),
    ("Cosh", 32, &[NAN]),
    ("Tanh", 32, &[NAN]),
    ("Asinh", 32, &[NAN]),
    ("Atan2", 32, &[NAN, ONE]),
    ("Pow", 32, &[NEG_ONE, HALF]),
    ("Exp", 32, &[NAN]),
    ("Exp2", 32, &[NAN]),
    ("Log", 32, &[NEG_MIN_DENORMAL]),
    ("Log2", 32, &[NEG_ONE]),
    ("Sqrt", 32, &[NEG_MIN_DENORMAL]),
    ("InverseSqrt", 32, &[NEG_ONE]),
    ("FMix", 32, &[INF, ONE, ONE]),
    ("NMin", 32, &[NAN, NAN]),
    ("Ldexp", 32, &[NAN, 0]),
];

fn family(name: &str) -> &'static OpFamily {
    let mut families = SECTIONS.iter().flat_map(|section| section.iter().copied());
    families.find(|family| family.name == name).unwrap_or_else(|| panic!("no kernel {name}"))
}

#[test]
fn every_kernel_is_right_at_its_edges() {
    for &(name, width, operands, expected) in [INTEGERS, ARITHMETIC, FUNCTIONS].into_iter().flatten() {
        check(family(name), width, operands, expected);
    }
}

#[test]
fn invalid_operations_give_the_canonical_nan() {
    for &(name, width, operands) in NANS {
        let kernel = family(name).kernel(width).expect("a kernel of this width");
        let nan = if width == 64 { 0x7FF8 << 48 } else { NAN };
        for bits in results(kernel, operands) {
            assert_eq!(bits, nan, "{kernel:?} of {operands:x?}: {bits:#x}");
        }
    }
}

#[test]
fn every_kernel_has_edge_vectors() {
    let named = |family: &OpFamily| {
        let vectors = [INTEGERS, ARITHMETIC, FUNCTIONS].into_iter().flatten().map(|vector| vector.0);
        vectors.chain(NANS.iter().map(|vector| vector.0)).any(|name| name == family.name)
    };
    let families = SECTIONS.iter().flat_map(|section| section.iter());
    let missing: Vec<_> = families.filter(|family| !named(family)).map(|family| family.name).collect();
    assert!(missing.is_empty(), "no edge values for {missing:?}");
}
