//! Float controls (`SPV_KHR_float_controls`): denormals and rounding as an entry point asks for
//! them.

use crate::execution::instructions::run::Shader;

fn run(mode: &str, body: &str) -> [u32; 16] {
    Shader {
        annotations: mode,
        // Nothing here folds: every operand is an input.
        declarations: "
            %tiny = OpConstant %uint 1
            %one = OpConstant %uint 0x3f800000
            %three_quarters = OpConstant %uint 0x33c00000
            %large = OpConstant %uint 0xffffffff
            %nothing = OpConstant %float 0",
        body,
        ..Shader::default()
    }
    .run()[7]
}

const ARITHMETIC: &str = "
    %zero = OpIMul %uint %id %u0
    %a = OpIAdd %uint %tiny %zero
    %b = OpIAdd %uint %one %zero
    %c = OpIAdd %uint %three_quarters %zero
    %d = OpIAdd %uint %large %zero
    %x = OpBitcast %float %a
    %y = OpBitcast %float %b
    %z = OpBitcast %float %c
    %product = OpFMul %float %x %y
    %equal = OpFOrdEqual %bool %x %nothing
    %sum = OpFAdd %float %y %z
    %converted = OpConvertUToF %float %d
    %product_bits = OpBitcast %uint %product
    %equal_bits = OpSelect %uint %equal %u1 %u0
    %sum_bits = OpBitcast %uint %sum
    %converted_bits = OpBitcast %uint %converted
    out 0 %product_bits
    out 1 %equal_bits
    out 2 %sum_bits
    out 3 %converted_bits";

/// 2^-149 * 1, 2^-149 == 0, 1 + 0.75 * 2^-23, float(2^32 - 1).
fn results(mode: &str) -> [u32; 4] {
    std::array::from_fn(|at| run(mode, ARITHMETIC)[at])
}

#[test]
fn what_holds_anyway_changes_nothing() {
    // Denormals are kept; 0.75 ulp rounds up; 2^32 - 1 rounds to 2^32.
    let plain = [1, 0, 0x3F80_0001, 0x4F80_0000];
    assert_eq!(results(""), plain);
    for mode in ["DenormPreserve", "RoundingModeRTE", "SignedZeroInfNanPreserve"] {
        assert_eq!(results(&format!("OpExecutionMode %main {mode} 32")), plain, "{mode}");
    }
    // Another width.
    assert_eq!(results("OpExecutionMode %main DenormFlushToZero 16"), plain);
    assert_eq!(results("OpExecutionMode %main RoundingModeRTZ 64"), plain);
}

#[test]
fn denormals_are_flushed() {
    // The product is 0, and the operand of the comparison counts as 0.
    let flushed = [0, 1, 0x3F80_0001, 0x4F80_0000];
    assert_eq!(results("OpExecutionMode %main DenormFlushToZero 32"), flushed);
}

#[test]
fn results_are_cut_off() {
    // 1 + 0.75 ulp is cut off to 1, 2^32 - 1 to 2^32 - 2^8.
    let cut = [1, 0, 0x3F80_0000, 0x4F7F_FFFF];
    assert_eq!(results("OpExecutionMode %main RoundingModeRTZ 32"), cut);
}

#[test]
fn a_decorated_conversion_rounds_as_it_says() {
    let run = |mode: &str, decorations: &str| {
        let annotations = format!("{mode}\n{decorations}");
        let words = Shader {
            capabilities: "OpCapability BFloat16TypeKHR",
            annotations: &annotations,
            declarations: "
                %bf = OpTypeFloat 16 0
                %bits = OpConstant %uint 0x3f80ffff",
            body: "
                %zero = OpIMul %uint %id %u0
                %a = OpIAdd %uint %bits %zero
                %x = OpBitcast %float %a
                %h = OpFConvert %half %x
                %b = OpFConvert %bf %x
                %h_bits = OpBitcast %ushort %h
                %b_bits = OpBitcast %ushort %b
                %h_word = OpUConvert %uint %h_bits
                %b_word = OpUConvert %uint %b_bits
                out 0 %h_word
                out 1 %b_word",
            ..Shader::default()
        }
        .run()[7];
        [words[0], words[1]]
    };
    const MODE: &str = "OpExecutionMode %main RoundingModeRTZ 16";
    // 1 + 2^-7 - 2^-23 lies above the middle of the f16 1 + 7 * 2^-10 and 1 + 2^-7, and above that
    // of the bfloat16 1 and 1 + 2^-7.
    assert_eq!(run("", ""), [0x3C08, 0x3F81]);
    assert_eq!(run("", "OpDecorate %h FPRoundingMode 1\nOpDecorate %b FPRoundingMode 1"), [0x3C07, 0x3F80]);
    // A decoration stands before the mode, which is that of f16 alone.
    assert_eq!(run(MODE, ""), [0x3C07, 0x3F81]);
    assert_eq!(run(MODE, "OpDecorate %h FPRoundingMode 0"), [0x3C08, 0x3F81]);
}
