//! `OpSpecConstantOp` with every instruction that it may hold in a shader, one by one, at edge
//! values. The results are those of the same instruction in a function, by hand.

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
