//! Rules about arithmetic, conversions and the functions of `GLSL.std.450`.

rules! {
    INT_DIV_ZERO "int-div-zero" UndefinedBehavior
        "The divisor of an integer division is not 0."
        "SPIR-V 3.3.13, OpUDiv, OpSDiv, OpUMod, OpSRem, OpSMod: behavior is undefined if Operand 2 is 0"
        "test the divisor first"
    INT_DIV_OVERFLOW "int-div-overflow" UndefinedBehavior
        "The least integer is not divided by -1."
        "SPIR-V 3.3.13, OpSDiv, OpSRem, OpSMod: behavior is undefined if the division overflows"
        "divide unsigned numbers, or test for -1"
    SREM_NEGATIVE "srem-negative" UndefinedValue
        "Both operands of OpSRem and OpSMod are not negative."
        "Vulkan, \"Precision and Operation of SPIR-V Instructions\": without maintenance8 the result is undefined"
        "make the operand positive first, as in ((x % n) + n) % n on unsigned numbers, or use & for powers of two"
    NO_WRAP_BROKEN "no-wrap-broken" UndefinedBehavior
        "An operation decorated NoSignedWrap or NoUnsignedWrap does not overflow."
        "SPIR-V 3.20, NoSignedWrap, NoUnsignedWrap: behavior is undefined if the instruction overflows"
        "compile without the promise, or keep the operands within the range of their type"
    DOT_OVERFLOW "dot-overflow" UndefinedValue
        "The products of an accumulating dot product, and their sum, fit the result."
        "SPIR-V 3.3.13, Op*DotAccSat: the result is undefined if they overflow before the last accumulation"
        "accumulate in a wider integer: only the last addition saturates"
    SHIFT_RANGE "shift-range" UndefinedValue
        "A shift is by less than the width of the shifted value."
        "SPIR-V 3.3.14, OpShift*: the result is undefined if Shift is greater than or equal to the bit width"
        "treat a shift by the whole width apart, or mask the amount"
    BITFIELD_RANGE "bitfield-range" UndefinedValue
        "The offset and count of a bit field, and their sum, are at most the width of the value."
        "SPIR-V 3.3.14, OpBitField*: the result is undefined if Count or Offset or their sum is greater"
        "a field of no bits is fine; clamp offset and count"
    FLOAT_TO_INT "float-to-int" UndefinedBehavior
        "A float that is converted to an integer fits in it, and is no NaN."
        "SPIR-V 3.3.11, OpConvertFToU, OpConvertFToS: behavior is undefined if Result Type is not wide enough"
        "clamp the float to the range of the integer before it is converted"
    FLOAT_NARROW "float-narrow" Lint
        "A finite float that is converted to a narrower one stays finite."
        "the result is infinite, and undefined where the operation is NotInf"
        "clamp the value first: the greatest half is 65504"
    INT_ABS_MIN "int-abs-min" Lint
        "The least integer, whose magnitude is no integer, is not negated."
        "the result is negative"
        "use a wider or an unsigned integer"
    FREM_ZERO "frem-zero" UndefinedValue
        "The divisor of OpFRem and OpFMod is not 0."
        "SPIR-V 3.3.13, OpFRem, OpFMod: the result is undefined if Operand 2 is 0"
        "test the divisor before mod()"
    ASIN_ACOS "asin-acos" UndefinedValue
        "The operand of Asin and Acos is from -1 to 1."
        "GLSL.std.450, Asin, Acos; Vulkan, \"Precision and Operation of SPIR-V Instructions\": a mathematically undefined result is poison"
        "clamp it to [-1, 1]: a dot product of two unit vectors may be a little more than 1"
    ACOSH_ATANH "acosh-atanh" UndefinedValue
        "The operand of Acosh is at least 1, that of Atanh between -1 and 1."
        "GLSL.std.450, Acosh, Atanh; Vulkan, \"Precision and Operation of SPIR-V Instructions\": a mathematically undefined result is poison"
        "clamp the operand"
    ATAN2_ZERO "atan2-zero" UndefinedValue
        "The operands of Atan2 are not both 0."
        "GLSL.std.450, Atan2: the result is undefined if x and y are both 0"
        "treat the origin apart: atan(0, 0) has no angle"
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
        "take the root of max(x, 0.0), and test discriminants first"
    MINMAX_NAN "minmax-nan" UndefinedValue
        "No operand of FMin, FMax, FClamp and Step is a NaN."
        "GLSL.std.450, FMin, FMax: which operand is the result is undefined if one of the operands is a NaN"
        "test for a NaN first, or mend what makes it: 0 * infinity, 0 / 0, the root of a negative number"
    CLAMP_INVERTED "clamp-inverted" UndefinedValue
        "The lower bound of a clamp is not above the upper one."
        "GLSL.std.450, FClamp, UClamp, SClamp, NClamp: the result is undefined if minVal > maxVal"
        "order the bounds first"
    SMOOTHSTEP_EDGES "smoothstep-edges" UndefinedValue
        "The first edge of SmoothStep is below the second."
        "GLSL.std.450, SmoothStep: the result is undefined if edge0 >= edge1"
        "write 1.0 - smoothstep(edge1, edge0, x) for a falling step"
    NORMALIZE_ZERO "normalize-zero" UndefinedValue
        "The length of a normalized vector is not 0, and its square neither over- nor underflows."
        "GLSL.std.450, Normalize; Vulkan, \"Precision and Operation of SPIR-V Instructions\": a mathematically undefined result is poison"
        "test dot(v, v) before normalize(v)"
    LDEXP_RANGE "ldexp-range" UndefinedValue
        "The exponent of Ldexp is at most 128, 1024 for double and 16 for half."
        "GLSL.std.450, Ldexp: the result is undefined beyond"
        "clamp the exponent"
    FREXP_SPECIAL "frexp-special" UndefinedValue
        "The operand of Frexp is neither a NaN nor infinite."
        "GLSL.std.450, Frexp: the result is undefined for them"
        "test for NaN and infinity first"
    INVERSE_SINGULAR "inverse-singular" UndefinedValue
        "A matrix that is inverted has a determinant that is a normal number."
        "GLSL.std.450, MatrixInverse: the result is undefined if x is singular or poorly conditioned"
        "test determinant(m) before inverse(m); a scale of 0 on one axis has no inverse"
    PACKDOUBLE_SPECIAL "packdouble-special" UndefinedValue
        "The words of PackDouble2x32 make neither a NaN nor an infinity."
        "GLSL.std.450, PackDouble2x32: the value is unspecified if an IEEE 754 infinity or NaN is created"
        "keep such bits as integers (uvec2, uint64_t), or test the exponent first"
    TRIG_SPECIAL "trig-special" Lint
        "The operand of Sin, Cos, Tan and Fract is not infinite."
        "an infinity has no sine or fraction: the result is a NaN at best"
        "reduce the angle, or test for infinity first"
    FASTMATH_FLAGS "fastmath-flags" UndefinedValue
        "Operands and result of an operation decorated NotNaN or NotInf are no NaN, or not infinite."
        "SPIR-V 3.15, FP Fast Math Mode: else the operation returns an undefined value"
        "compile without fast math, or keep NaN and infinity away from the operation"
    ASSUME_FALSE "assume-false" UndefinedBehavior
        "The condition of OpAssumeTrueKHR is true where it is executed."
        "SPV_KHR_expect_assume, OpAssumeTrueKHR: behavior is undefined if Condition is false"
        "assume only what the shader has made sure of"
    NAN_TEST_FOLDED "nan-test-folded" Lint
        "Where isnan() or isinf() holds, the shader declares that NaN and infinity are preserved."
        "Vulkan, without SignedZeroInfNanPreserve or FPFastMathDefault: a test for NaN may be folded to false"
        "test the bits: (floatBitsToUint(x) & 0x7fffffffu) > 0x7f800000u for a NaN, == for infinity"
    NAN_OUTPUT "nan-output" Lint
        "No NaN is written to a buffer or an image, printed, or traced with."
        "Vulkan: without SignedZeroInfNanPreserve an operation that makes or takes a NaN gives an undefined value"
        "look at the instruction that made the NaN, and keep its operands from it"
    NAN_BRANCH "nan-branch" Lint
        "No comparison with a NaN decides a branch."
        "Vulkan: without SignedZeroInfNanPreserve an operation that makes or takes a NaN gives an undefined value"
        "look at the instruction that made the NaN, and keep its operands from it"
    ULP_DOMAIN "ulp-domain" UndefinedValue
        "No quotient that does not exist, 0 / 0 or infinity / infinity, is written, printed or traced with."
        "Vulkan, \"Precision of Individual Operations\", ULP: a result that is not mathematically defined is undefined"
        "test the divisor first"
    FDIV_ZERO "fdiv-zero" Lint
        "No quotient by zero is written to a buffer or an image, printed, or the origin or direction of a ray."
        "Vulkan, \"Precision of Individual Operations\", ULP: a result that is not mathematically defined is undefined"
        "test the divisor first; in a slab test, or behind a comparison, the infinity does no harm and is not told"
    FASTMATH_DEFAULT "fastmath-default" Lint
        "No infinity to which an operation overflows is written to a buffer or an image, printed, or traced with."
        "Vulkan, \"Precision and Operation of SPIR-V Instructions\": unless preserved, infinities may be replaced with undefined values"
        "clamp the operands, or the result where it is finite, or declare SignedZeroInfNanPreserve"
    FDIV_RANGE "fdiv-range" Lint
        "The magnitude of a divisor is at most 2^126, of half 2^14."
        "Vulkan, \"Precision of Individual Operations\", OpFDiv: the error is bounded for divisors within [2^-126, 2^126] alone"
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
        "The operand of FSign is no NaN."
        "GLSL.std.450, FSign: 1, 0 or -1, of which a NaN gives any"
        "test for a NaN first, or look at the instruction that made it"
    REFLECT_UNIT "reflect-unit" Lint
        "The normal of Reflect, and both vectors of Refract, have length 1."
        "GLSL.std.450, Reflect, Refract: the vectors must be normalized to achieve the desired result"
        "normalize the vector: an interpolated or transformed normal is shorter or longer"
    EXPECT_WRONG "expect-wrong" Lint
        "The value of OpExpectKHR is mostly the expected one."
        "SPV_KHR_expect_assume, OpExpectKHR: the implementation optimises for the expected value"
        "expect the other value, or leave the hint out"
    FLOAT_COUNTER "float-counter" Lint
        "The step of a float that counts a loop changes it."
        "a step below half the distance to the next float adds nothing: the loop counts no further"
        "count in an integer, and compute the float from it"
}
