//! Expressions of the debugger that need no variables: operators, conversions, constructors and
//! functions. Values are calculated by hand.

use crate::debugger::source_variables::Stopped;

fn check(expected: &[(&str, &str)]) {
    Stopped::new("locals.comp.gVS.spv").assert_all(expected);
}

#[test]
fn literals_have_the_types_of_their_suffixes() {
    check(&[
        ("7", "int 7"),
        ("7u", "uint 7"),
        ("0xFFFFFFFFu", "uint 4294967295"),
        ("0xFFFFFFFF", "int -1"),
        ("4294967295", "uint 4294967295"),
        ("5000000000l", "int64_t 5000000000"),
        ("1ul << 40", "uint64_t 1099511627776"),
        ("1.5", "float 1.5"),
        (".25", "float 0.25"),
        ("2.f", "float 2"),
        ("1e3", "float 1000"),
        ("1.5h", "float16_t 1.5"),
        ("0.1lf", "double 0.1"),
        ("true", "bool true"),
        ("1.x", "int 1"),
    ]);
}

#[test]
fn operators_bind_as_in_c() {
    check(&[
        ("1 + 2 * 3", "int 7"),
        ("(1 + 2) * 3", "int 9"),
        ("7 - 2 - 1", "int 4"),
        ("1 << 2 + 1", "int 8"),
        ("1 | 2 ^ 3 & 2", "int 1"),
        ("1 + 1 == 2 && 3 < 2 || true", "bool true"),
        ("-2 * -3", "int 6"),
        ("!true || ~0 == -1", "bool true"),
        ("1 < 2 ? 3 : 4", "int 3"),
        ("false ? 1 : true ? 2 : 3", "int 2"),
        ("-7 / 2", "int -3"),
        ("-7 % 3", "int -1"),
        ("-8 >> 1", "int -4"),
        ("0xFFFFFFFFu >> 28", "uint 15"),
        ("2147483647 + 1", "int -2147483648"),
        ("0u - 1u", "uint 4294967295"),
    ]);
}

#[test]
fn operands_meet_in_the_types_of_glsl() {
    check(&[
        ("1 + 2u", "uint 3"),
        ("1 + 0.5", "float 1.5"),
        ("1u + 0.5lf", "double 1.5"),
        ("1.5h + 1", "float16_t 2.5"),
        ("1 + 1l", "int64_t 2"),
        ("vec2(1, 2) * 3", "vec2(3, 6)"),
        ("1 - vec3(1, 2, 3)", "vec3(0, -1, -2)"),
        ("ivec2(1, 2) + vec2(0.5)", "vec2(1.5, 2.5)"),
        // 2^24 + 1 is no float, and 0.1 + 0.2 is rounded to one.
        ("16777216.0 + 1.0", "float 16777216"),
        ("0.1 + 0.2 == 0.3", "bool true"),
        ("0.1lf + 0.2lf == 0.3lf", "bool false"),
        ("vec2(1, 2) == vec2(1, 2)", "bool true"),
        ("vec2(1, 2) != vec2(1, 3)", "bool true"),
        ("vec2(1, 5) < vec2(2, 4)", "bvec2(true, false)"),
        ("float(1) / 0.0", "float inf"),
    ]);
}

#[test]
fn vectors_and_matrices_are_made_and_taken_apart() {
    check(&[
        ("vec4(vec2(1, 2), 3, 4).wzyx", "vec4(4, 3, 2, 1)"),
        ("float3(1, 2, 3).rg", "vec2(1, 2)"),
        ("vec3(vec4(1, 2, 3, 4))", "vec3(1, 2, 3)"),
        ("uvec3(1.9, -1.0, 3e9)", "uvec3(1, 0, 3000000000)"),
        ("int(-1.9)", "int -1"),
        ("(int) 2.5 + 1", "int 3"),
        ("bool(0.0)", "bool false"),
        ("uint16_t(65537)", "uint16_t 1"),
        ("int8_t(200)", "int8_t -56"),
        ("mat2(2)", "mat2((2, 0), (0, 2))"),
        ("mat2(1, 2, 3, 4)[1]", "vec2(3, 4)"),
        ("mat2(1, 2, 3, 4) * vec2(1, 10)", "vec2(31, 42)"),
        ("vec2(1, 10) * mat2(1, 2, 3, 4)", "vec2(21, 43)"),
        ("mul(mat2(1, 2, 3, 4), vec2(1, 10))", "vec2(21, 43)"),
        ("mat2(1, 2, 3, 4) * mat2(0, 1, 1, 0)", "mat2((3, 4), (1, 2))"),
        ("mat3(mat2(5))[2]", "vec3(0, 0, 1)"),
        ("vec3(7)[2]", "float 7"),
        ("vec3(1).length()", "int 3"),
    ]);
}

#[test]
fn functions_are_those_of_the_languages() {
    check(&[
        ("length(vec2(3, 4))", "float 5"),
        ("distance(vec2(1, 1), vec2(4, 5))", "float 5"),
        ("dot(vec3(1, 2, 3), vec3(4, 5, 6))", "float 32"),
        ("normalize(vec2(0, 8))", "vec2(0, 1)"),
        ("cross(vec3(1, 0, 0), vec3(0, 1, 0))", "vec3(0, 0, 1)"),
        ("abs(ivec2(-3, 4))", "ivec2(3, 4)"),
        ("abs(-0.5)", "float 0.5"),
        ("min(vec2(1, 5), 3)", "vec2(1, 3)"),
        ("max(2, 3u)", "uint 3"),
        ("clamp(7, 1, 5)", "int 5"),
        ("mix(2.0, 4.0, 0.25)", "float 2.5"),
        ("lerp(2.0, 4.0, 0.25)", "float 2.5"),
        ("sqrt(2.25)", "float 1.5"),
        ("floor(-1.5)", "float -2"),
        ("fract(1.75)", "float 0.75"),
        ("any(bvec2(false, true))", "bool true"),
        ("all(bvec2(false, true))", "bool false"),
        ("isnan(0.0 / 0.0)", "bool true"),
        ("isinf(vec2(1.0 / 0.0, 1))", "bvec2(true, false)"),
        ("floatBitsToUint(1.0)", "uint 1065353216"),
        ("asfloat(0x40000000)", "float 2"),
    ]);
}

/// Elementary functions are those of shaders here: correctly rounded.
#[test]
fn functions_are_instructions_of_the_interpreter() {
    check(&[
        // The floats nearest to sqrt(2), sin 1, cos 1, tan 1, e and ln 2.
        ("floatBitsToUint(pow(2.0, 0.5)) == 0x3FB504F3u", "bool true"),
        ("floatBitsToUint(sin(1.0)) == 0x3F576AA4u", "bool true"),
        ("floatBitsToUint(cos(1.0)) == 0x3F0A5140u", "bool true"),
        ("floatBitsToUint(tan(1.0)) == 0x3FC75923u", "bool true"),
        ("floatBitsToUint(exp(1.0)) == 0x402DF854u", "bool true"),
        ("floatBitsToUint(log(2.0)) == 0x3F317218u", "bool true"),
        ("exp2(3.0)", "float 8"),
        ("log2(vec2(8, 0.25))", "vec2(3, -2)"),
        ("inversesqrt(4.0)", "float 0.5"),
        ("sqrt(2.25lf)", "double 1.5"),
        ("floor(1.5h)", "float16_t 1"),
        ("pow(-1.0, 0.5)", "float NaN"),
        ("ceil(-1.5)", "float -1"),
        ("fract(-0.25)", "float 0.75"),
        ("sign(vec3(-2, 0, 5))", "vec3(-1, 0, 1)"),
        ("sign(-7)", "int -1"),
        ("abs(7u)", "uint 7"),
        ("mod(-1.0, 3.0)", "float 2"),
        ("fmod(-1.0, 3.0)", "float -1"),
        ("step(2.0, vec2(1, 3))", "vec2(0, 1)"),
        // 3 / 16 - 2 / 64
        ("smoothstep(0.0, 1.0, 0.25)", "float 0.15625"),
        ("saturate(vec2(-1, 0.5))", "vec2(0, 0.5)"),
        ("min(3u, 2u)", "uint 2"),
        ("max(-3, -2)", "int -2"),
        ("mix(vec2(0, 4), vec2(8), 0.5)", "vec2(4, 6)"),
        ("mix(vec2(1, 2), vec2(3, 4), bvec2(false, true))", "vec2(1, 4)"),
        ("reflect(vec2(1, -1), vec2(0, 1))", "vec2(1, 1)"),
        // Without a change of the medium the direction stays; beyond the critical angle there is
        // none.
        ("refract(vec2(0, -1), vec2(0, 1), 1.0)", "vec2(0, -1)"),
        ("refract(vec2(1, 0), vec2(0, 1), 1.5)", "vec2(0, 0)"),
        ("transpose(mat2x3(1, 2, 3, 4, 5, 6))", "mat3x2((1, 4), (2, 5), (3, 6))"),
        ("determinant(mat2(1, 2, 3, 4))", "float -2"),
        ("inverse(mat2(2, 1, 1, 1))", "mat2((1, -1), (-1, 2))"),
        ("atan(1.0, 0.0) == atan(1.0) * 2.0", "bool true"),
        ("any(vec2(0, 2))", "bool true"),
    ]);
    check(&[
        ("sni(1.0)", "at character 1 of the expression: no function `sni`; did you mean `sin`?"),
        ("sin(true)", "at character 1 of the expression: `sin` is not defined for bool"),
        ("transpose(1.0)", "at character 1 of the expression: `transpose` is not defined for float"),
        (
            "cross(vec2(1), vec2(1))",
            "at character 1 of the expression: `cross` is not defined for vec2 and vec2",
        ),
        ("dot(vec2(1), vec3(1))", "at character 1 of the expression: `dot` is not defined for vec2 and vec3"),
    ]);
}

#[test]
fn mistakes_are_told_with_their_columns() {
    check(&[
        ("1 +", "at character 4 of the expression: expected a value, found the end"),
        ("(1 + 2", "at character 7 of the expression: expected `)`, found the end"),
        ("1 2", "at character 3 of the expression: expected an operator or the end, found a number"),
        ("min(1 2)", "at character 7 of the expression: expected `,` or `)`, found a number"),
        ("a = 1", "at character 3 of the expression: an expression cannot assign; `==` compares"),
        ("1 + #", "at character 5 of the expression: unexpected `#`"),
        ("vec3(1).", "at character 9 of the expression: expected the name of a member, found the end"),
        ("vec3(1).xyw", "at character 9 of the expression: vec3 has no component `xyw`"),
        ("vec2(1) + vec3(1)", "at character 9 of the expression: `+` is not defined for vec2 and vec3"),
        ("true + 1", "at character 6 of the expression: `+` is not defined for bool and int"),
        ("1.5 & 1", "at character 5 of the expression: `&` is not defined for float and int"),
        ("1 / 0", "at character 3 of the expression: division by zero"),
        ("1 << 32", "at character 3 of the expression: a shift by 32 of a 32-bit value"),
        ("lenght(vec2(1))", "at character 1 of the expression: no function `lenght`; did you mean `length`?"),
        ("dot(vec2(1))", "at character 1 of the expression: `dot` takes 2 arguments, not 1"),
        ("vec3(1, 2)", "at character 1 of the expression: `vec3` has 3 components, not 2"),
        ("vec2(1)[2]", "at character 8 of the expression: 2 is outside vec2"),
        ("vec2(1)[0.5]", "at character 9 of the expression: float 0.5 is not an index"),
        ("vec2(1) ? 1 : 2", "at character 1 of the expression: vec2 is not a condition: use `any` or `all`"),
        ("1z", "at character 1 of the expression: `z` is not a suffix of integers"),
        ("%0", "at character 1 of the expression: %0 is not a value"),
    ]);
    let deep = format!("{}1{}", "(".repeat(500), ")".repeat(500));
    let found = Stopped::new("locals.comp.gVS.spv").eval(&deep);
    assert_eq!(found, "at character 65 of the expression: more than 64 levels of brackets and operators");
    let long = format!("1{}", " + 1".repeat(1000));
    assert!(Stopped::new("locals.comp.gVS.spv").eval(&long).contains("more than 1024 parts"));
}
