//! `OpSpecConstantOp` with every instruction that it may hold in a shader, one by one, at edge
//! values. The results are those of the same instruction in a function, by hand.

use anyhit::{TrapCode, TrapOperands};

use crate::execution::instructions::run::Shader;

/// Instruction, type of the result, operands, bits of the result.
const OPERATIONS: &[(&str, &str, &str, u32)] = &[
    ("SConvert", "int", "%short_least", 0xFFFF_8000),
    ("UConvert", "uint", "%ushort_most", 0xFFFF),
    ("FConvert", "float", "%double_tenth", 0x3DCC_CCCD),
    ("SNegate", "int", "%least", 0x8000_0000),
    ("Not", "uint", "%most", 0x8000_0000),
    ("IAdd", "uint", "%all %one", 0),
    ("ISub", "uint", "%zero %one", 0xFFFF_FFFF),
    ("IMul", "uint", "%all %all", 1),
    ("UDiv", "uint", "%all %two", 0x7FFF_FFFF),
    ("SDiv", "int", "%least %itwo", 0xC000_0000),
    ("UMod", "uint", "%all %high", 0x7FFF_FFFF),
    // -2^31 = 3 * -715827882 - 2
    ("SRem", "int", "%least %ithree", 0xFFFF_FFFE),
    ("SMod", "int", "%least %ithree", 1),
    ("ShiftRightLogical", "uint", "%high %thirty_one", 1),
    ("ShiftRightArithmetic", "int", "%least %thirty_one", 0xFFFF_FFFF),
    ("ShiftLeftLogical", "uint", "%all %thirty_one", 0x8000_0000),
    ("BitwiseOr", "uint", "%high %one", 0x8000_0001),
    ("BitwiseXor", "uint", "%all %high", 0x7FFF_FFFF),
    ("BitwiseAnd", "uint", "%all %high", 0x8000_0000),
    ("CompositeExtract", "uint", "%pair 1", 0xFFFF_FFFF),
    ("LogicalOr", "bool", "%no %yes", 1),
    ("LogicalAnd", "bool", "%no %yes", 0),
    ("LogicalNot", "bool", "%no", 1),
    ("LogicalEqual", "bool", "%no %no", 1),
    ("LogicalNotEqual", "bool", "%yes %no", 1),
    ("Select", "uint", "%no %one %high", 0x8000_0000),
    ("IEqual", "bool", "%all %high", 0),
    ("INotEqual", "bool", "%all %high", 1),
    ("ULessThan", "bool", "%high %all", 1),
    ("SLessThan", "bool", "%least %itwo", 1),
    ("UGreaterThan", "bool", "%high %one", 1),
    ("SGreaterThan", "bool", "%least %itwo", 0),
    ("ULessThanEqual", "bool", "%high %high", 1),
    ("SLessThanEqual", "bool", "%itwo %least", 0),
    ("UGreaterThanEqual", "bool", "%all %all", 1),
    ("SGreaterThanEqual", "bool", "%least %least", 1),
    // 0.1 to the nearest f16 and back
    ("QuantizeToF16", "float", "%tenth", 0x3DCC_C000),
];

const OPERANDS: &str = "
    %short = OpTypeInt 16 1
    %short_least = OpSpecConstant %short 0xFFFF8000
    %ushort_most = OpSpecConstant %ushort 0xFFFF
    %double_tenth = OpSpecConstant %double 0.1d
    %tenth = OpSpecConstant %float 0.1
    %least = OpSpecConstant %int 0x80000000
    %itwo = OpSpecConstant %int 2
    %ithree = OpSpecConstant %int 3
    %zero = OpSpecConstant %uint 0
    %one = OpSpecConstant %uint 1
    %two = OpSpecConstant %uint 2
    %thirty_one = OpSpecConstant %uint 31
    %most = OpSpecConstant %uint 0x7FFFFFFF
    %high = OpSpecConstant %uint 0x80000000
    %all = OpSpecConstant %uint 0xFFFFFFFF
    %yes = OpSpecConstantTrue %bool
    %no = OpSpecConstantFalse %bool
    %pair = OpSpecConstantComposite %uint2 %one %all";

/// A line that stores a constant of a type as a word.
fn store(slot: usize, ty: &str, name: &str) -> String {
    match ty {
        "bool" => format!("%word{slot} = OpSelect %uint {name} %u1 %u0\nout {slot} %word{slot}\n"),
        "uint" => format!("out {slot} {name}\n"),
        _ => format!("%word{slot} = OpBitcast %uint {name}\nout {slot} %word{slot}\n"),
    }
}

#[test]
fn every_instruction_that_is_allowed_folds() {
    for few in OPERATIONS.chunks(16) {
        let mut declarations = OPERANDS.to_owned();
        let mut body = String::new();
        for (slot, (name, ty, operands, _)) in few.iter().enumerate() {
            declarations += &format!("\n%folded{slot} = OpSpecConstantOp %{ty} {name} {operands}");
            body += &store(slot, ty, &format!("%folded{slot}"));
        }
        let found = Shader { declarations: &declarations, body: &body, ..Shader::default() }.run();
        for (slot, (name, _, operands, expected)) in few.iter().enumerate() {
            assert_eq!(found[0][slot], *expected, "{name} {operands}: {:#x}", found[0][slot]);
        }
    }
}

#[test]
fn vectors_are_taken_apart_and_made() {
    let declarations = format!(
        "{OPERANDS}
        %swapped = OpSpecConstantOp %uint3 VectorShuffle %pair %pair 3 0 1
        %changed = OpSpecConstantOp %uint2 CompositeInsert %high %pair 0
        %sum = OpSpecConstantOp %uint2 IAdd %changed %pair
        %chosen = OpSpecConstantOp %uint2 Select %no %pair %sum"
    );
    let mut body = String::new();
    for (slot, (vector, component)) in [
        ("swapped", 0),
        ("swapped", 1),
        ("swapped", 2),
        ("changed", 0),
        ("changed", 1),
        ("chosen", 0),
        ("chosen", 1),
    ]
    .into_iter()
    .enumerate()
    {
        body += &format!(
            "%part{slot} = OpCompositeExtract %uint %{vector} {component}\nout {slot} %part{slot}\n"
        );
    }
    let found = Shader { declarations: &declarations, body: &body, ..Shader::default() }.run();
    // pair is (1, 2^32 - 1): places 3, 0, 1 of it twice; then (2^31, 2^32 - 1), and their sum.
    let expected = [0xFFFF_FFFF, 1, 0xFFFF_FFFF, 0x8000_0000, 0xFFFF_FFFF, 0x8000_0001, 0xFFFF_FFFE];
    assert_eq!(found[0][..7], expected);
}

/// `SPV_KHR_poison_freeze`: the result of `OpFreezeKHR` is its operand, unless that is poison; then
/// it is any value, which does not change from use to use.
#[test]
fn a_frozen_value_is_the_value_and_does_not_change() {
    let shader = Shader {
        declarations: "
            %pair = OpTypeStruct %ulong %float2
            %poison = OpPoisonKHR %uint
            %u48 = OpConstant %uint 48",
        body: "
            %wide = OpUConvert %ulong %id
            %high = OpShiftLeftLogical %ulong %wide %u48
            %float_id = OpConvertUToF %float %id
            %floats = OpCompositeConstruct %float2 %float_id %float_id
            %made = OpCompositeConstruct %pair %high %floats
            %frozen = OpFreezeKHR %pair %made
            %high_frozen = OpCompositeExtract %ulong %frozen 0
            %shifted = OpShiftRightLogical %ulong %high_frozen %u48
            %narrow = OpUConvert %uint %shifted
            out 0 %narrow
            %second = OpCompositeExtract %float %frozen 1 1
            %bits = OpBitcast %uint %second
            out 1 %bits
            %is_zero = OpIEqual %bool %id %u0
            %frozen_bool = OpFreezeKHR %bool %is_zero
            %chosen = OpSelect %uint %frozen_bool %u1 %u2
            out 2 %chosen
            %frozen_constant = OpFreezeKHR %uint %u16
            out 3 %frozen_constant
            %local = OpPoisonKHR %uint2
            %stable = OpFreezeKHR %uint2 %local
            %of_module = OpFreezeKHR %uint %poison
            %x = OpCompositeExtract %uint %stable 0
            %x_again = OpCompositeExtract %uint %stable 0
            %difference = OpISub %uint %x %x_again
            out 4 %difference
            %product = OpIMul %uint %of_module %u0
            out 5 %product",
        ..Shader::default()
    };
    for (id, words) in (0..).zip(shader.run()) {
        let chosen = if id == 0 { 1 } else { 2 };
        assert_eq!(words[..6], [id, (id as f32).to_bits(), chosen, 16, 0, 0]);
    }
}

/// `SPV_KHR_constant_data`: elements are packed from the least significant bits on, and what is
/// behind the last one is ignored.
#[test]
fn constant_data_is_packed() {
    let shader = Shader {
        capabilities: "OpCapability ConstantDataKHR\nOpExtension \"SPV_KHR_constant_data\"",
        annotations: "OpDecorate %short_data SpecId 3",
        declarations: "
            %chars = OpTypeArray %uchar %u5
            %shorts = OpTypeArray %ushort %u3
            %ints = OpTypeArray %uint %u2
            %longs = OpTypeArray %ulong %u2
            %char_data = OpConstantDataKHR %chars 0x64636261 0xFFFFFF65
            %short_data = OpSpecConstantDataKHR %shorts 0x00020001 0xFFFF0003
            %int_data = OpConstantDataKHR %ints 5 0xFFFFFFFF
            %long_data = OpConstantDataKHR %longs 1 2 3 4",
        body: "
            %first = OpCompositeExtract %uchar %char_data 0
            %first_word = OpUConvert %uint %first
            out 0 %first_word
            %last = OpCompositeExtract %uchar %char_data 4
            %last_word = OpUConvert %uint %last
            out 1 %last_word
            %second_short = OpCompositeExtract %ushort %short_data 1
            %second_short_word = OpUConvert %uint %second_short
            out 2 %second_short_word
            %last_short = OpCompositeExtract %ushort %short_data 2
            %last_short_word = OpUConvert %uint %last_short
            out 3 %last_short_word
            %last_int = OpCompositeExtract %uint %int_data 1
            out 4 %last_int
            %last_long = OpCompositeExtract %ulong %long_data 1
            %low = OpUConvert %uint %last_long
            out 5 %low
            %high_long = OpShiftRightLogical %ulong %last_long %u32
            %high = OpUConvert %uint %high_long
            out 6 %high",
        ..Shader::default()
    };
    for words in shader.run() {
        assert_eq!(words[..7], [0x61, 0x65, 2, 3, 0xFFFF_FFFF, 3, 4]);
    }
}

#[test]
fn constant_data_has_the_size_of_its_array() {
    let refused = |declarations: &str| {
        let capabilities = "OpCapability ConstantDataKHR\nOpExtension \"SPV_KHR_constant_data\"";
        Shader { capabilities, declarations, ..Shader::default() }.refused()
    };
    let error = refused("%chars = OpTypeArray %uchar %u5\n%data = OpConstantDataKHR %chars 1");
    assert_eq!(error.message(), "OpConstantDataKHR: 1 words of data for 5 elements of 8 bits, which take 2");
    for declarations in [
        "%data = OpConstantDataKHR %uint 1",
        "%floats = OpTypeArray %float %u2\n%data = OpConstantDataKHR %floats 1 2",
    ] {
        let error = refused(declarations);
        assert!(error.message().contains("expected an array of integers"), "{}", error.render());
    }
}

/// `SPV_KHR_abort`: the message is that of the invocation, and what it has stored before stays.
#[test]
fn an_abort_ends_the_invocation_with_its_message() {
    let shader = Shader {
        capabilities: "OpCapability ConstantDataKHR\nOpExtension \"SPV_KHR_constant_data\"
            OpCapability AbortKHR\nOpExtension \"SPV_KHR_abort\"",
        annotations: "
            OpDecorate %text UTFEncodedKHR
            OpDecorate %text_x UTFEncodedKHR
            OpDecorate %text_x ArrayStride 1
            OpDecorate %bytes_x ArrayStride 1
            OpMemberDecorate %message_x 0 Offset 0
            OpMemberDecorate %message_x 1 Offset 4
            OpMemberDecorate %message_x 2 Offset 8
            OpMemberDecorate %message_x 3 Offset 16",
        declarations: "
            %text = OpTypeArray %uchar %u4
            %bytes = OpTypeArray %uchar %u2
            %words = OpConstantDataKHR %text 0x0075253A
            %two_bytes = OpConstantDataKHR %bytes 0x0807
            %message = OpTypeStruct %text %uint %ulong %bytes
            %text_x = OpTypeArray %uchar %u4
            %bytes_x = OpTypeArray %uchar %u2
            %message_x = OpTypeStruct %text_x %uint %ulong %bytes_x",
        body: "
            %aborts = OpUGreaterThanEqual %bool %id %u7
            OpSelectionMerge %end None
            OpBranchConditional %aborts %abort %end
            %abort = OpLabel
            %wide = OpUConvert %ulong %id
            %made = OpCompositeConstruct %message %words %id %wide %two_bytes
            OpAbortKHR %message_x %made
            %end = OpLabel",
        ..Shader::default()
    };
    let error = shader.refused();
    let trap = error.trap().expect("a trap");
    // ":%u" is the format of the first number.
    let message = ":7 7 7 8".to_owned();
    assert_eq!((trap.code, trap.launch_id), (TrapCode::Aborted, [7, 0, 0]));
    assert_eq!(trap.operands, TrapOperands::Abort { message });
    assert!(error.render().contains(":7 7 7 8"), "{}", error.render());
    let wrong = shader.body.replace("%message_x %made", "%text_x %made");
    let error = Shader { body: &wrong, ..shader }.refused();
    assert!(error.message().starts_with("OpAbortKHR: a message of type "), "{}", error.render());
}
