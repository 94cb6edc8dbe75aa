//! Arithmetic with carries and in two words, bit fields, saturation, relations: instructions whose
//! rows stand behind a decoder of their own.

use crate::execution::instructions::run::Shader;

#[test]
fn carries_and_wide_products() {
    let found = Shader {
        declarations: "
            %two = OpTypeStruct %uint %uint
            %most = OpConstant %uint 0xFFFFFFFF
            %half_of_all = OpConstant %uint 0x80000000",
        body: "
            %sum = OpIAddCarry %two %most %id
            %sum_0 = OpCompositeExtract %uint %sum 0
            out 0 %sum_0
            %sum_1 = OpCompositeExtract %uint %sum 1
            out 1 %sum_1
            %difference = OpISubBorrow %two %id %u1
            %difference_0 = OpCompositeExtract %uint %difference 0
            out 2 %difference_0
            %difference_1 = OpCompositeExtract %uint %difference 1
            out 3 %difference_1
            %product = OpUMulExtended %two %half_of_all %id
            %product_0 = OpCompositeExtract %uint %product 0
            out 4 %product_0
            %product_1 = OpCompositeExtract %uint %product 1
            out 5 %product_1
            %negative = OpSMulExtended %two %most %id
            %negative_0 = OpCompositeExtract %uint %negative 0
            out 6 %negative_0
            %negative_1 = OpCompositeExtract %uint %negative 1
            out 7 %negative_1",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        let id = id as u32;
        let expected = [
            id.wrapping_sub(1),
            u32::from(id > 0),
            id.wrapping_sub(1),
            u32::from(id == 0),
            id << 31,
            id >> 1,
            // -1 times id, in 64 bits.
            id.wrapping_neg(),
            if id == 0 { 0 } else { u32::MAX },
        ];
        assert_eq!(words[..8], expected);
    }
}

#[test]
fn bit_fields() {
    let found = Shader {
        declarations: "%thirty = OpConstant %uint 30",
        body: "
            %inserted = OpBitFieldInsert %uint %id %u7 %u8 %u3
            out 0 %inserted
            %high = OpShiftLeftLogical %uint %id %thirty
            %signed = OpBitFieldSExtract %uint %high %thirty %u2
            out 1 %signed
            %unsigned = OpBitFieldUExtract %uint %high %thirty %u2
            out 2 %unsigned",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        let id = id as u32;
        let signed = [0, 1, -2, -1][id as usize % 4] as u32;
        assert_eq!(words[..3], [id | 0x700, signed, id % 4]);
    }
}

#[test]
fn relations() {
    let found = Shader {
        declarations: "
            %bool2 = OpTypeVector %bool 2
            %two_and_five = OpConstantComposite %uint2 %u2 %u5
            %three_point = OpConstant %float 3.0",
        body: "
            %same = OpCompositeConstruct %uint2 %id %id
            %equal = OpIEqual %bool2 %same %two_and_five
            %any = OpAny %bool %equal
            %any_word = OpSelect %uint %any %u1 %u0
            out 0 %any_word
            %parts = OpUGreaterThan %bool2 %same %two_and_five
            %all = OpAll %bool %parts
            %all_word = OpSelect %uint %all %u1 %u0
            out 1 %all_word
            %xor = OpLogicalNotEqual %bool %any %all
            %xor_word = OpSelect %uint %xor %u1 %u0
            out 2 %xor_word
            %signed = OpBitcast %int %id
            %minus = OpISub %int %u4 %signed
            %ge = OpSGreaterThanEqual %bool %minus %u0
            %ge_word = OpSelect %uint %ge %u1 %u0
            out 3 %ge_word
            %f = OpConvertUToF %float %id
            %different = OpLessOrGreater %bool %f %three_point
            %different_word = OpSelect %uint %different %u1 %u0
            out 4 %different_word
            %saturated = OpSatConvertSToU %uint %minus
            out 5 %saturated",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        let (any, all) = (id == 2 || id == 5, id > 5);
        let expected = [any, all, any != all, id <= 4, id != 3].map(u32::from);
        assert_eq!(words[..5], expected);
        assert_eq!(words[5], 4u32.saturating_sub(id as u32));
    }
}

#[test]
fn a_dot_product_of_mixed_signs_saturates() {
    let found = Shader {
        capabilities: "OpCapability DotProduct\nOpCapability DotProductInput4x8BitPacked",
        declarations: "
            %all_minus = OpConstant %uint 0xFFFFFFFF
            %near_least = OpConstant %int -2147483000",
        body: "
            %packed = OpBitwiseOr %uint %all_minus %id
            %sum = OpSUDotAccSat %int %packed %packed %near_least PackedVectorFormat4x8Bit
            %word = OpBitcast %uint %sum
            out 0 %word",
        ..Shader::default()
    }
    .run();
    // Four times -1 * 255 is -1020: below the least integer.
    for words in found {
        assert_eq!(words[0], 0x8000_0000);
    }
}
