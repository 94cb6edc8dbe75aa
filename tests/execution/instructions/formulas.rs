//! What the specification defines by a formula follows it operation by operation, left to right,
//! each rounded. The operands are chosen so that another order, a fused product or a division in
//! the place of a reciprocal would show. By hand: e = 2^-24 is half a unit in the last place of 1,
//! so that 1 + e = 1 (a tie, to even) and 1 + 2e = 1 + 2^-23.

use crate::execution::instructions::run::Shader;

/// Runs a body on floats given as bits, `%x0`, `%x1`, ..., which no constant folding sees; a line
/// `result N %value` stores a float.
fn run(declarations: &str, inputs: &[u32], body: &str) -> [u32; 16] {
    let mut text = String::from("%zero_id = OpIMul %uint %id %u0\n");
    let mut constants = String::new();
    for (at, bits) in inputs.iter().enumerate() {
        constants += &format!("%word{at} = OpConstant %uint {bits}\n");
        text +=
            &format!("%given{at} = OpIAdd %uint %word{at} %zero_id\n%x{at} = OpBitcast %float %given{at}\n");
    }
    for (at, line) in body.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["result", index, value] => {
                text += &format!("%bits{at} = OpBitcast %uint {value}\nout {index} %bits{at}\n");
            }
            _ => text += &format!("{line}\n"),
        }
    }
    let declarations = format!("{constants}{declarations}");
    let found = Shader { declarations: &declarations, body: &text, ..Shader::default() }.run();
    assert!(found.iter().all(|words| *words == found[0]), "all invocations do the same");
    found[0]
}

/// 1, 2^-24, 2^-12, 0
const ONE: u32 = 0x3F80_0000;
const E: u32 = 0x3380_0000;
const ROOT: u32 = 0x3980_0000;
const ZERO: u32 = 0;

#[test]
fn sums_of_products_go_from_left_to_right() {
    // (1 + e) + e = 1; from the right it would be 1 + 2e.
    let found = run(
        "%matrix = OpTypeMatrix %float3 3",
        &[ONE, E, ZERO],
        "%v = OpCompositeConstruct %float3 %x0 %x1 %x1
         %ones = OpCompositeConstruct %float3 %x0 %x0 %x0
         %none = OpCompositeConstruct %float3 %x2 %x2 %x2
         %back = OpCompositeConstruct %float3 %x1 %x1 %x0
         %dot = OpDot %float %v %ones
         result 0 %dot
         %dot_back = OpDot %float %back %ones
         result 1 %dot_back
         ; columns (1, 1, 1), (e, e, e), (e, e, e): every row is (1, e, e)
         %small = OpVectorTimesScalar %float3 %ones %x1
         %rows = OpCompositeConstruct %matrix %ones %small %small
         %rows_by_ones = OpMatrixTimesVector %float3 %rows %ones
         %a = OpCompositeExtract %float %rows_by_ones 1
         result 2 %a
         %columns = OpCompositeConstruct %matrix %none %v %back
         %ones_by_columns = OpVectorTimesMatrix %float3 %ones %columns
         %b = OpCompositeExtract %float %ones_by_columns 1
         result 3 %b
         %c = OpCompositeExtract %float %ones_by_columns 2
         result 4 %c
         %product = OpMatrixTimesMatrix %matrix %rows %rows
         ; row (1, e, e) times column (1, 1, 1)
         %d = OpCompositeExtract %float %product 0 2
         result 5 %d
         ; row (1, e, e) times column (e, e, e): e, e^2 and e^2 are lost
         %g = OpCompositeExtract %float %product 2 0
         result 6 %g
         %outer = OpOuterProduct %matrix %v %back
         %h = OpCompositeExtract %float %outer 2 1
         result 7 %h",
    );
    // e + e + 1 = 2e + 1
    assert_eq!(found[..8], [ONE, ONE + 1, ONE, ONE, ONE + 1, ONE, E, E]);
}

#[test]
fn products_are_rounded_before_they_are_added() {
    // (1 + 2^-12)^2 = 1 + 2^-11 + 2^-24, a tie to 1 + 2^-11. Fused, the difference would be 2^-24.
    let near = 0x3F80_0800;
    let square = 0x3F80_1000;
    let found = run(
        "%matrix2 = OpTypeMatrix %float2 2
         %matrix3 = OpTypeMatrix %float3 3
         %matrix4 = OpTypeMatrix %float4 4",
        &[near, square, ONE, ZERO],
        "%a = OpCompositeConstruct %float2 %x0 %x1
         %b = OpCompositeConstruct %float2 %x2 %x0
         %m = OpCompositeConstruct %matrix2 %a %b
         %two = OpExtInst %float %glsl Determinant %m
         result 0 %two
         %p = OpCompositeConstruct %float3 %x3 %x0 %x1
         %q = OpCompositeConstruct %float3 %x3 %x2 %x0
         %cross = OpExtInst %float3 %glsl Cross %p %q
         %c = OpCompositeExtract %float %cross 0
         result 1 %c
         ; 1 in the first column's first place: the determinant is that minor
         %first = OpCompositeConstruct %float3 %x2 %x3 %x3
         %m3 = OpCompositeConstruct %matrix3 %first %p %q
         %three = OpExtInst %float %glsl Determinant %m3
         result 2 %three
         %first4 = OpCompositeConstruct %float4 %x2 %x3 %x3 %x3
         %second4 = OpCompositeConstruct %float4 %x3 %x2 %x3 %x3
         %third4 = OpCompositeConstruct %float4 %x3 %x3 %x0 %x1
         %fourth4 = OpCompositeConstruct %float4 %x3 %x3 %x2 %x0
         %m4 = OpCompositeConstruct %matrix4 %first4 %second4 %third4 %fourth4
         %four = OpExtInst %float %glsl Determinant %m4
         result 3 %four
         %sum = OpExtInst %float %glsl Fma %x0 %x0 %x2
         result 4 %sum",
    );
    // Fma: 1 + 2^-11 + 1
    assert_eq!(found[..5], [ZERO, ZERO, ZERO, ZERO, 0x4000_0800]);
}

#[test]
fn lengths_are_roots_of_such_sums() {
    // 1 + e + e + e = 1, as each is a tie; from the right 1 + 3e rounds to 1 + 2^-22, whose root is
    // 1 + 2^-23.
    let found = run(
        "",
        &[ONE, ROOT, E | 1 << 31, ZERO, 0x1E80_0000, 0xC000_0000],
        "%v = OpCompositeConstruct %float4 %x0 %x1 %x1 %x1
         %length = OpExtInst %float %glsl Length %v
         result 0 %length
         %back = OpCompositeConstruct %float4 %x1 %x1 %x1 %x0
         %length_back = OpExtInst %float %glsl Length %back
         result 1 %length_back
         ; 1 - -e rounds to 1 before it is squared
         %w = OpCompositeConstruct %float4 %x2 %x3 %x3 %x3
         %distance = OpExtInst %float %glsl Distance %v %w
         result 2 %distance
         ; the magnitude of a scalar, though its square is 0
         %small = OpExtInst %float %glsl Length %x4
         result 3 %small
         %scalar = OpExtInst %float %glsl Distance %x3 %x5
         result 4 %scalar",
    );
    // 2^-66 is 0x1E800000.
    assert_eq!(found[..5], [ONE, ONE + 1, ONE, 0x1E80_0000, 0x4000_0000]);
}

#[test]
fn normalize_multiplies_by_the_reciprocal_root() {
    // 1 / sqrt(17) rounds to 0x3E785B42 (0.242535621...); 4 times that is exact. 1 / length would
    // give 0x3E785B43, as sqrt(17) rounds downwards to 0x4083F07B.
    let found = run(
        "",
        &[ONE, 0x4080_0000, ZERO],
        "%v = OpCompositeConstruct %float3 %x0 %x1 %x2
         %unit = OpExtInst %float3 %glsl Normalize %v
         %x = OpCompositeExtract %float %unit 0
         result 0 %x
         %y = OpCompositeExtract %float %unit 1
         result 1 %y
         %z = OpCompositeExtract %float %unit 2
         result 2 %z",
    );
    assert_eq!(found[..3], [0x3E78_5B42, 0x3F78_5B42, ZERO]);
}

#[test]
fn an_inverse_multiplies_by_the_reciprocal_determinant() {
    // 1/41 rounds to 0x3CC7CE0C, and 41 times that to 1 - 2^-24.
    let found = run(
        "%matrix2 = OpTypeMatrix %float2 2",
        &[ONE, 0x4224_0000, ZERO],
        "%a = OpCompositeConstruct %float2 %x0 %x2
         %b = OpCompositeConstruct %float2 %x2 %x1
         %m = OpCompositeConstruct %matrix2 %a %b
         %inverse = OpExtInst %matrix2 %glsl MatrixInverse %m
         %x = OpCompositeExtract %float %inverse 0 0
         result 0 %x
         %y = OpCompositeExtract %float %inverse 1 1
         result 1 %y
         ; the cofactor -0 times 1/41
         %z = OpCompositeExtract %float %inverse 0 1
         result 2 %z",
    );
    assert_eq!(found[..3], [0x3F7F_FFFF, 0x3CC7_CE0C, 1 << 31]);
}

#[test]
fn reflect_rounds_twice_the_product_times_the_normal() {
    // I = (0.1, 0.7), N = (0.6, 0.8), rounded: 0x3DCCCCCD, 0x3F333333, 0x3F19999A, 0x3F4CCCCD.
    // 0.6 * 0.1 -> 0x3D75C290, 0.8 * 0.7 -> 0x3F0F5C29, sum 0x3F1EB852, twice 0x3F9EB852;
    // times N 0x3F3E76C9 and 0x3F7DF3B7; I minus that. Fused it would be 0xBF24DD30, 0xBE958107.
    let found = run(
        "",
        &[0x3DCC_CCCD, 0x3F33_3333, 0x3F19_999A, 0x3F4C_CCCD],
        "%i = OpCompositeConstruct %float2 %x0 %x1
         %n = OpCompositeConstruct %float2 %x2 %x3
         %r = OpExtInst %float2 %glsl Reflect %i %n
         %x = OpCompositeExtract %float %r 0
         result 0 %x
         %y = OpCompositeExtract %float %r 1
         result 1 %y",
    );
    assert_eq!(found[..2], [0xBF24_DD2F, 0xBE95_8108]);
}

#[test]
fn refract_follows_its_formula() {
    // I = (0.6, -0.8), N = (0, 1), eta = 2/3, rounded. dot = -0.8 = 0xBF4CCCCD, its square
    // 0x3F23D70B, 1 less that 0x3EB851EA, eta^2 0x3EE38E3A, their product 0x3E23D70A, k =
    // 0x3F570A3E with the root 0x3F6AA0BD. eta * dot = 0xBF088889, and their sum is 0x3EC43068. eta
    // * I - sum * N = (0x3ECCCCCE, 0xBF088889 - 0x3EC43068 = 0xBF6AA0BD).
    let body = "
        %i = OpCompositeConstruct %float2 %x0 %x1
        %n = OpCompositeConstruct %float2 %x2 %x3
        %r = OpExtInst %float2 %glsl Refract %i %n %x4
        %x = OpCompositeExtract %float %r 0
        result 0 %x
        %y = OpCompositeExtract %float %r 1
        result 1 %y";
    let found = run("", &[0x3F19_999A, 0xBF4C_CCCD, ZERO, ONE, 0x3F2A_AAAB], body);
    assert_eq!(found[..2], [0x3ECC_CCCE, 0xBF6A_A0BD]);
    // eta = 2: k = 1 - 4 * 0.36 < 0, total reflection gives 0.
    let found = run("", &[0x3F19_999A, 0xBF4C_CCCD, ZERO, ONE, 0x4000_0000], body);
    assert_eq!(found[..2], [ZERO, ZERO]);
}

#[test]
fn faceforward_turns_unless_the_product_is_negative() {
    let body = "
        %n = OpCompositeConstruct %float2 %x0 %x1
        %i = OpCompositeConstruct %float2 %x2 %x3
        %r = OpExtInst %float2 %glsl FaceForward %n %i %n
        %x = OpCompositeExtract %float %r 0
        result 0 %x
        %y = OpCompositeExtract %float %r 1
        result 1 %y";
    // dot(Nref, I) is -1, then +0, then a NaN: turned but for the first one. 0 turns to -0.
    assert_eq!(run("", &[ONE, ZERO, ONE | 1 << 31, ZERO], body)[..2], [ONE, ZERO]);
    assert_eq!(run("", &[ONE, ZERO, ZERO, ONE], body)[..2], [ONE | 1 << 31, 1 << 31]);
    assert_eq!(run("", &[ONE, ZERO, 0x7FC0_0000, ONE], body)[..2], [ONE | 1 << 31, 1 << 31]);
}

#[test]
fn mix_and_smoothstep_follow_their_formulas() {
    // mix(1, 2, 1/3): 1 - a = 0x3F2AAAAA, 2 a = 0x3F2AAAAB, sum 0x3FAAAAAA; x + a (y - x) would be
    // 0x3FAAAAAB.
    // smoothstep(0, 5, 1): t = 0.2 = 0x3E4CCCCD, t t = 0x3D23D70B, 3 - 2 t = 0x40266666, product
    // 0x3DD4FDF4; t (t (3 - 2 t)) would be 0x3DD4FDF3.
    // smoothstep(0, 7, 1): t = 0x3E124925, t t = 0x3CA72F06, 3 - 2 t = 0x402DB6DB, product
    // 0x3D62E463; rounded once it would be 0x3D62E464.
    let found = run(
        "",
        &[ONE, 0x4000_0000, 0x3EAA_AAAB, ZERO, 0x40A0_0000, 0x40E0_0000],
        "%mix = OpExtInst %float %glsl FMix %x0 %x1 %x2
         result 0 %mix
         %five = OpExtInst %float %glsl SmoothStep %x3 %x4 %x0
         result 1 %five
         %seven = OpExtInst %float %glsl SmoothStep %x3 %x5 %x0
         result 2 %seven",
    );
    assert_eq!(found[..3], [0x3FAA_AAAA, 0x3DD4_FDF4, 0x3D62_E463]);
}
