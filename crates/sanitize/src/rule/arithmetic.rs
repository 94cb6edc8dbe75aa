//! Rules about arithmetic, conversions and the functions of `GLSL.std.450`.

rules! {
    INT_DIV_ZERO "int-div-zero" UndefinedBehavior
        "The divisor of an integer division is not 0."
        "SPIR-V 3.3.13, OpUDiv, OpSDiv, OpUMod, OpSRem, OpSMod: behavior is undefined if Operand 2 is 0"
        "test the divisor first"
    INT_DIV_OVERFLOW "int-div-overflow" UndefinedBehavior
        "The minimum signed integer is not divided by -1."
        "SPIR-V 3.3.13, OpSDiv, OpSRem, OpSMod: behavior is undefined if the division overflows"
        "divide unsigned integers, or test for -1"
    SREM_NEGATIVE "srem-negative" UndefinedValue
        "Neither operand of OpSRem and OpSMod is negative."
        "Vulkan, \"Precision and Operation of SPIR-V Instructions\": without maintenance8 the result is undefined"
        "make the operand positive first, as in ((x % n) + n) % n on unsigned numbers, or use & for powers of two"
    NO_WRAP_BROKEN "no-wrap-broken" UndefinedBehavior
        "An operation decorated NoSignedWrap or NoUnsignedWrap does not overflow."
        "SPIR-V 3.20, NoSignedWrap, NoUnsignedWrap: behavior is undefined if the instruction overflows"
        "compile without the decoration, or keep the result within the range of its type"
    DOT_OVERFLOW "dot-overflow" UndefinedValue
        "The products of an accumulating dot product, and their sum, fit in the result type."
        "SPIR-V 3.3.13, Op*DotAccSat: the result is undefined if they overflow before the last accumulation"
        "accumulate in a wider integer: only the last addition saturates"
    SHIFT_RANGE "shift-range" UndefinedValue
        "A shift amount is less than the bit width of the shifted value."
        "SPIR-V 3.3.14, OpShift*: the result is undefined if Shift is greater than or equal to the bit width"
        "handle a shift by the full width separately, or mask the shift amount"
    BITFIELD_RANGE "bitfield-range" UndefinedValue
        "The offset and count of a bit field, and their sum, are at most the width of the value."
        "SPIR-V 3.3.14, OpBitField*: the result is undefined if Count or Offset or their sum is greater"
        "clamp offset and count; a field of zero bits is allowed"
    FLOAT_TO_INT "float-to-int" UndefinedBehavior
        "A float that is converted to an integer fits in the integer type, and is not a NaN."
        "SPIR-V 3.3.11, OpConvertFToU, OpConvertFToS: behavior is undefined if Result Type is not wide enough"
        "clamp the float to the range of the integer type before the conversion"
    FLOAT_NARROW "float-narrow" Lint
        "A finite float that is converted to a narrower type stays finite."
        "the result is infinite, and undefined where the operation is NotInf"
        "clamp the value first: the largest finite half is 65504"
    INT_ABS_MIN "int-abs-min" Lint
        "The minimum signed integer, whose magnitude is not representable, is not negated."
        "the result is negative"
        "use a wider or an unsigned integer"
    FREM_ZERO "frem-zero" UndefinedValue
        "The divisor of OpFRem and OpFMod is not 0."
        "SPIR-V 3.3.13, OpFRem, OpFMod: the result is undefined if Operand 2 is 0"
        "test the divisor before mod()"
    ASIN_ACOS "asin-acos" UndefinedValue
        "The operand of Asin and Acos is in [-1, 1]."
        "GLSL.std.450, Asin, Acos; Vulkan, \"Precision and Operation of SPIR-V Instructions\": a mathematically undefined result is poison"
        "clamp it to [-1, 1]: a dot product of two unit vectors may be a little more than 1"
    ACOSH_ATANH "acosh-atanh" UndefinedValue
        "The operand of Acosh is at least 1, that of Atanh between -1 and 1."
        "GLSL.std.450, Acosh, Atanh; Vulkan, \"Precision and Operation of SPIR-V Instructions\": a mathematically undefined result is poison"
        "clamp the operand"
    ATAN2_ZERO "atan2-zero" UndefinedValue
        "The operands of Atan2 are not both 0."
        "GLSL.std.450, Atan2: the result is undefined if x and y are both 0"
        "handle the origin separately: atan(0, 0) has no angle"
    POW_DOMAIN "pow-domain" UndefinedValue
        "The base of Pow is positive, or it is 0 and the exponent is positive."
        "GLSL.std.450, Pow: the result is undefined if x < 0, or if x = 0 and y <= 0"
        "write x * x for a square, and pow(max(x, 0.0), y) or pow(abs(x), y) elsewhere"
    LOG_DOMAIN "log-domain" UndefinedValue
        "The operand of Log and Log2 is positive."
        "GLSL 8.2 and GLSL.std.450, Log, Log2: the result is undefined if x <= 0"
        "take the logarithm of max(x, a small number)"
    SQRT_DOMAIN "sqrt-domain" UndefinedValue
        "The operand of Sqrt is not negative, that of InverseSqrt is positive."
        "GLSL.std.450, Sqrt, InverseSqrt; Vulkan, \"Precision and Operation of SPIR-V Instructions\": a mathematically undefined result is poison"
        "take the square root of max(x, 0.0), and test discriminants first"
    MINMAX_NAN "minmax-nan" UndefinedValue
        "No operand of FMin, FMax, FClamp and Step is a NaN."
        "GLSL.std.450, FMin, FMax: which operand is the result is undefined if one of the operands is a NaN"
        "test for a NaN first, or fix its cause: 0 * infinity, 0 / 0, the square root of a negative number"
    CLAMP_INVERTED "clamp-inverted" UndefinedValue
        "The lower bound of a clamp is not above the upper one."
        "GLSL.std.450, FClamp, UClamp, SClamp, NClamp: the result is undefined if minVal > maxVal"
        "order the bounds first"
    SMOOTHSTEP_EDGES "smoothstep-edges" UndefinedValue
        "The first edge of SmoothStep is below the second."
        "GLSL.std.450, SmoothStep: the result is undefined if edge0 >= edge1"
        "write 1.0 - smoothstep(edge1, edge0, x) for a falling step"
    NORMALIZE_ZERO "normalize-zero" UndefinedValue
        "The length of a vector to normalize is not 0, and its square neither overflows nor underflows."
        "GLSL.std.450, Normalize; Vulkan, \"Precision and Operation of SPIR-V Instructions\": a mathematically undefined result is poison"
        "test dot(v, v) before normalize(v)"
    LDEXP_RANGE "ldexp-range" UndefinedValue
        "The exponent of Ldexp is at most 128 (1024 for double, 16 for half)."
        "GLSL.std.450, Ldexp: the result is undefined for a greater exponent"
        "clamp the exponent"
    FREXP_SPECIAL "frexp-special" UndefinedValue
        "The operand of Frexp is neither a NaN nor infinite."
        "GLSL.std.450, Frexp: the result is undefined for a NaN or an infinity"
        "test for NaN and infinity first"
    INVERSE_SINGULAR "inverse-singular" UndefinedValue
        "The determinant of a matrix to invert is a normal number."
        "GLSL.std.450, MatrixInverse: the result is undefined if x is singular or poorly conditioned"
        "test determinant(m) before inverse(m); a scale of 0 on one axis has no inverse"
    PACKDOUBLE_SPECIAL "packdouble-special" UndefinedValue
        "The words passed to PackDouble2x32 form neither a NaN nor an infinity."
        "GLSL.std.450, PackDouble2x32: the value is unspecified if an IEEE 754 infinity or NaN is created"
        "keep such bits as integers (uvec2, uint64_t), or test the exponent first"
    TRIG_SPECIAL "trig-special" Lint
        "The operand of Sin, Cos, Tan and Fract is not infinite."
        "an infinity has no sine or fraction: the result is a NaN at best"
        "reduce the angle, or test for infinity first"
    FASTMATH_FLAGS "fastmath-flags" UndefinedValue
        "An operation decorated NotNaN has no NaN as an operand or result, and one decorated NotInf no \
         infinity."
        "SPIR-V 3.15, FP Fast Math Mode: otherwise the operation returns an undefined value"
        "compile without fast math, or keep NaN and infinity away from the operation"
    ASSUME_FALSE "assume-false" UndefinedBehavior
        "The condition of OpAssumeTrueKHR is true where it is executed."
        "SPV_KHR_expect_assume, OpAssumeTrueKHR: behavior is undefined if Condition is false"
        "assume only conditions that the shader guarantees"
    NAN_TEST_FOLDED "nan-test-folded" Lint
        "A shader in which isnan() or isinf() returns true declares that NaN and infinity are preserved."
        "Vulkan, without SignedZeroInfNanPreserve or FPFastMathDefault: a test for NaN may be folded to false"
        "test the bits: (floatBitsToUint(x) & 0x7fffffffu) > 0x7f800000u for a NaN, == for infinity"
    NAN_OUTPUT "nan-output" Lint
        "No NaN is written to a buffer or an image, printed, or used in a trace."
        "Vulkan: without SignedZeroInfNanPreserve, an operation that produces or consumes a NaN returns an \
         undefined value"
        "find the instruction that made the NaN, and restrict its operands"
    NAN_BRANCH "nan-branch" Lint
        "No comparison with a NaN decides a branch."
        "Vulkan: without SignedZeroInfNanPreserve, an operation that produces or consumes a NaN returns an \
         undefined value"
        "find the instruction that made the NaN, and restrict its operands"
    ULP_DOMAIN "ulp-domain" UndefinedValue
        "No undefined quotient (0 / 0 or infinity / infinity) is written, printed, or used in a trace."
        "Vulkan, \"Precision of Individual Operations\", ULP: a result that is not mathematically defined is undefined"
        "test the divisor first"
    FDIV_ZERO "fdiv-zero" Lint
        "No result of a division by zero is written to a buffer or an image, printed, or used as the \
         origin or direction of a ray."
        "Vulkan, \"Precision of Individual Operations\", ULP: a result that is not mathematically defined is undefined"
        "test the divisor first; an infinity that is only compared, as in a slab test, is harmless and not \
         reported"
    FASTMATH_DEFAULT "fastmath-default" Lint
        "No infinity made by an overflow is written to a buffer or an image, printed, or used in a trace."
        "Vulkan, \"Precision and Operation of SPIR-V Instructions\": unless preserved, infinities may be replaced with undefined values"
        "clamp the operands, or the result where it is finite, or declare SignedZeroInfNanPreserve"
    FDIV_RANGE "fdiv-range" Lint
        "The magnitude of a divisor is at most 2^126 (2^14 for half)."
        "Vulkan, \"Precision of Individual Operations\", OpFDiv: the error is bounded only for divisors \
         within [2^-126, 2^126]"
        "divide by a smaller number, or scale both operands: the quotient may be 0 or off by any amount"
    SUBNORMAL "subnormal" Lint
        "No subnormal number is a divisor, or decides a comparison."
        "Vulkan, \"Precision and Operation of SPIR-V Instructions\": unless DenormPreserve is declared, it may be flushed to 0"
        "compare with a small normal number instead of 0, such as 1e-30"
    ROUND_HALF "round-half" Lint
        "The fraction of the operand of Round is not 0.5."
        "GLSL.std.450, Round: a fraction of 0.5 rounds in a direction that the implementation chooses"
        "write roundEven(x), or floor(x + 0.5)"
    SIGN_NAN "sign-nan" Lint
        "The operand of FSign is not a NaN."
        "GLSL.std.450, FSign: the result is 1, 0 or -1; for a NaN it may be any of them"
        "test for a NaN first, or find the instruction that made it"
    REFLECT_UNIT "reflect-unit" Lint
        "The normal of Reflect, and both vectors of Refract, have length 1."
        "GLSL.std.450, Reflect, Refract: the vectors must be normalized to achieve the desired result"
        "normalize the vector: an interpolated or transformed normal is shorter or longer"
    EXPECT_WRONG "expect-wrong" Lint
        "The value of OpExpectKHR is mostly the expected one."
        "SPV_KHR_expect_assume, OpExpectKHR: the implementation optimises for the expected value"
        "expect the other value, or remove the hint"
    FLOAT_COUNTER "float-counter" Lint
        "Each step of a float loop counter changes its value."
        "a step below half the distance to the next float adds nothing: the counter stops changing"
        "count with an integer, and compute the float from it"
}
