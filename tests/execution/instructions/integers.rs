//! Dot products of integers, replicated composites and expectations.

use crate::execution::instructions::run::Shader;

#[test]
fn dot_products_widen_before_they_multiply() {
    // %id / 64 is 0 in all invocations: it keeps the operands from being folded.
    let found = Shader {
        capabilities: "OpCapability DotProduct\nOpCapability DotProductInput4x8BitPacked",
        declarations: "
            %char = OpTypeInt 8 1
            %char2 = OpTypeVector %char 2
            %uchar2 = OpTypeVector %uchar 2
            %low = OpConstant %char -128
            %high = OpConstant %char 127
            %most = OpConstant %uchar 255
            %signed = OpConstantComposite %char2 %low %high
            %unsigned = OpConstantComposite %uchar2 %most %most
            %packed_a = OpConstant %uint 0xFF028001
            %packed_b = OpConstant %uint 0x7F03FF02
            %large = OpConstant %int 2147483647
            %minus = OpConstant %uchar 250",
        body: "
            %zero = OpUDiv %uint %id %u32
            %zero_too = OpUDiv %uint %zero %u32
            %a = OpBitwiseOr %uint %packed_a %zero_too
            %b = OpBitwiseOr %uint %packed_b %zero_too
            ; bytes of a: 1, -128, 2, -1; of b: 2, -1, 3, 127
            %s = OpSDot %int %a %b PackedVectorFormat4x8Bit
            %s_bits = OpBitcast %uint %s
            out 0 %s_bits
            %u = OpUDot %uint %a %b PackedVectorFormat4x8Bit
            out 1 %u
            %su = OpSUDot %int %a %b PackedVectorFormat4x8Bit
            %su_bits = OpBitcast %uint %su
            out 2 %su_bits
            %v = OpSDot %int %signed %signed
            %v_bits = OpBitcast %uint %v
            out 3 %v_bits
            %w = OpUDot %ulong %unsigned %unsigned
            %w_bits = OpUConvert %uint %w
            out 4 %w_bits
            %narrow = OpUDot %uchar %unsigned %unsigned
            %narrow_bits = OpUConvert %uint %narrow
            out 5 %narrow_bits
            %full = OpSDotAccSat %int %v1 %v1 %large
            %full_bits = OpBitcast %uint %full
            out 6 %full_bits
            %narrow_full = OpUDotAccSat %uchar %unsigned %unsigned %minus
            %narrow_full_bits = OpUConvert %uint %narrow_full
            out 7 %narrow_full_bits"
            .replace("%v1 %v1", "%signed %signed")
            .as_str(),
        ..Shader::default()
    }
    .run();
    let expected = [
        // 1 * 2 + -128 * -1 + 2 * 3 + -1 * 127
        9,
        // 1 * 2 + 128 * 255 + 2 * 3 + 255 * 127
        65_033,
        // 1 * 2 + -128 * 255 + 2 * 3 + -1 * 127
        -32_759i32 as u32,
        // 128^2 + 127^2
        32_513,
        // 2 * 255^2
        130_050,
        // the same modulo 256
        2,
        // 32,513 more than the largest int
        0x7FFF_FFFF,
        // 2 more than 250
        252,
    ];
    for (id, words) in found.iter().enumerate() {
        // %id / 32 / 32 is 0 everywhere.
        assert_eq!(words[..8], expected, "invocation {id}");
    }
}

#[test]
fn replicated_composites_and_expected_values() {
    let found = Shader {
        capabilities: "OpCapability ReplicatedCompositesEXT\nOpCapability ExpectAssumeKHR",
        declarations: "%sevens = OpConstantCompositeReplicateEXT %uint3 %u7",
        body: "
            %ids = OpCompositeConstructReplicateEXT %uint3 %id
            %sum = OpIAdd %uint3 %ids %sevens
            %last = OpCompositeExtract %uint %sum 2
            %expected = OpExpectKHR %uint %last %u9
            OpAssumeTrueKHR %true
            OpMemoryBarrier %u1 %u8
            out 0 %expected",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        assert_eq!(words[0], id as u32 + 7);
    }
}
