//! Untyped pointers (`SPV_KHR_untyped_pointers`): each access says what lies there.

use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::RunOptions;

use crate::execution::instructions::run::Shader;
use crate::execution::instructions::workgroup::Workgroup;

const CAPABILITIES: &str = "
    OpCapability UntypedPointersKHR
    OpCapability VariablePointers
    OpCapability StorageBuffer16BitAccess
    OpCapability StorageBuffer8BitAccess
    OpExtension \"SPV_KHR_untyped_pointers\"";
const ANNOTATIONS: &str = "
    OpDecorate %a DescriptorSet 0
    OpDecorate %a Binding 1
    OpDecorate %words Block
    OpDecorate %all_words ArrayStride 4
    OpMemberDecorate %words 0 Offset 0
    OpDecorate %pairs Block
    OpDecorate %all_pairs ArrayStride 8
    OpMemberDecorate %pairs 0 Offset 0
    OpDecorate %shorts ArrayStride 2
    OpDecorate %step ArrayStride 12
    OpDecorate %table Block
    OpMemberDecorate %table 0 Offset 4
    OpMemberDecorate %table 0 RowMajor
    OpMemberDecorate %table 0 MatrixStride 8
    OpMemberDecorate %table 1 Offset 32
    OpMemberDecorate %table 1 ColMajor
    OpMemberDecorate %table 1 MatrixStride 12";
const DECLARATIONS: &str = "
    %untyped = OpTypeUntypedPointerKHR StorageBuffer
    %step = OpTypeUntypedPointerKHR StorageBuffer
    %all_words = OpTypeRuntimeArray %uint
    %words = OpTypeStruct %all_words
    %all_pairs = OpTypeRuntimeArray %float2
    %pairs = OpTypeStruct %all_pairs
    %shorts = OpTypeArray %ushort %u4
    %mat = OpTypeMatrix %float3 2
    %table = OpTypeStruct %mat %mat
    %a = OpUntypedVariableKHR %untyped StorageBuffer %words";

/// 20 words: the floats 0 to 15, then the integers 7 to 10.
fn resources() -> Resources {
    let floats = (0..16).map(|at| (at as f32).to_bits());
    let bytes: Vec<u8> = floats.chain(7..11).flat_map(u32::to_le_bytes).collect();
    Resources::default().bind(0, 1, Descriptor::Buffer(Buffer::new(&bytes)))
}

fn shader(body: &str) -> Shader<'_> {
    Shader {
        capabilities: CAPABILITIES,
        annotations: ANNOTATIONS,
        declarations: DECLARATIONS,
        body,
        invocations: Some(4),
        ..Shader::default()
    }
}

/// The words of the second invocation.
fn run(body: &str) -> [u32; 16] {
    shader(body).run_with(&mut resources).unwrap_or_else(|error| panic!("{}", error.render()))[1]
}

#[test]
fn a_place_is_read_as_what_the_instruction_says() {
    let words = run("
        %third = OpUntypedAccessChainKHR %untyped %words %a %u0 %u3
        %bits = OpLoad %uint %third
        out 0 %bits
        %float_three = OpLoad %float %third
        %six = OpFAdd %float %float_three %float_three
        %six_bits = OpBitcast %uint %six
        out 1 %six_bits
        %second_pair = OpUntypedInBoundsAccessChainKHR %untyped %pairs %a %u0 %u2
        %pair = OpLoad %float2 %second_pair
        %five = OpCompositeExtract %float %pair 1
        %five_bits = OpBitcast %uint %five
        out 2 %five_bits
        %high_half = OpUntypedAccessChainKHR %untyped %shorts %second_pair %u1
        %half_bits = OpLoad %ushort %high_half
        %half_word = OpUConvert %uint %half_bits
        out 3 %half_word
        %whole = OpUntypedAccessChainKHR %untyped %uint2 %second_pair
        %both = OpLoad %uint2 %whole
        %four_bits = OpCompositeExtract %uint %both 0
        out 4 %four_bits
        %odd = OpUntypedAccessChainKHR %untyped %words %a %u0 %id
        %one_bits = OpLoad %uint %odd
        out 5 %one_bits");
    let bits = f32::to_bits;
    assert_eq!(words[..6], [bits(3.0), bits(6.0), bits(5.0), bits(4.0) >> 16, bits(4.0), bits(1.0)]);
}

/// A typed pointer becomes an untyped one, through which other types are stored.
#[test]
fn a_place_is_written_as_what_the_instruction_says() {
    let words = run("
        %place = OpIAdd %uint %out_base %u3
        %untyped_place = OpUntypedAccessChainKHR %untyped %out_block %out %u0 %place
        %value = OpConvertUToF %float %id
        OpStore %untyped_place %value
        %next = OpUntypedAccessChainKHR %untyped %shorts %untyped_place %u3
        %half_id = OpUConvert %ushort %id
        OpStore %next %half_id");
    assert_eq!(words[3..5], [1_f32.to_bits(), 0x0001_0000]);
}

/// Rows and columns of matrices in a struct, whose layout the decorations of its members are.
#[test]
fn matrices_have_the_layout_of_the_struct_that_leads_to_them() {
    let words = run("
        %rows = OpUntypedAccessChainKHR %untyped %table %a %u0
        %of_rows = OpLoad %mat %rows
        %r12 = OpCompositeExtract %float %of_rows 1 2
        %r12_bits = OpBitcast %uint %r12
        out 0 %r12_bits
        %column = OpUntypedAccessChainKHR %untyped %table %a %u0 %u1
        %of_column = OpLoad %float3 %column
        %c1 = OpCompositeExtract %float %of_column 1
        %c1_bits = OpBitcast %uint %c1
        out 1 %c1_bits
        %element = OpUntypedAccessChainKHR %untyped %table %a %u0 %u1 %u0
        %of_element = OpLoad %float %element
        %e_bits = OpBitcast %uint %of_element
        out 2 %e_bits
        %columns = OpUntypedAccessChainKHR %untyped %table %a %u1
        %of_columns = OpLoad %mat %columns
        %k11 = OpCompositeExtract %float %of_columns 1 1
        %k11_bits = OpBitcast %uint %k11
        out 3 %k11_bits");
    // Word 1 + 2 * row + column of the row-major one, and 8 + 3 * column + row of the other.
    assert_eq!(words[..4], [6.0, 4.0, 2.0, 12.0].map(f32::to_bits));
}

#[test]
fn pointers_step_by_the_stride_of_their_type_and_differ_in_bytes() {
    let words = run("
        %begin = OpUntypedAccessChainKHR %step %words %a %u0 %u1
        %third = OpUntypedPtrAccessChainKHR %step %float2 %begin %u2 %u1
        %eight = OpLoad %float %third
        %eight_bits = OpBitcast %uint %eight
        out 0 %eight_bits
        %distance = OpPtrDiff %uint %third %begin
        out 1 %distance
        %again = OpUntypedInBoundsPtrAccessChainKHR %step %float2 %begin %u2 %u1
        %equal = OpPtrEqual %bool %third %again
        %typed_out = OpAccessChain %ptr_StorageBuffer_uint %out %u0 %u0
        %untyped_out = OpUntypedAccessChainKHR %untyped %out_block %out %u0 %u0
        %same = OpPtrEqual %bool %typed_out %untyped_out
        %both = OpLogicalAnd %bool %equal %same
        %equal_word = OpSelect %uint %both %u1 %u0
        out 2 %equal_word
        %count = OpUntypedArrayLengthKHR %uint %words %a 0
        out 3 %count
        %pair_count = OpUntypedArrayLengthKHR %uint %pairs %a 0
        out 4 %pair_count");
    assert_eq!(words[..5], [8_f32.to_bits(), 2 * 12 + 4, 1, 20, 10]);
}

/// `SPV_EXT_shader_64bit_indexing`: lengths may have 64 bits, and indices do anyway.
#[test]
fn lengths_have_64_bits_where_the_shader_asks_for_them() {
    let body = "
        %count = OpUntypedArrayLengthKHR %ulong %words %a 0
        %wide_one = OpUConvert %ulong %u1
        %last = OpISub %ulong %count %wide_one
        %low = OpUConvert %uint %count
        out 0 %low
        %pointer = OpUntypedAccessChainKHR %untyped %words %a %u0 %last
        %ten = OpLoad %uint %pointer
        out 1 %ten";
    let capabilities = format!(
        "{CAPABILITIES}\nOpCapability Shader64BitIndexingEXT\nOpExtension \"SPV_EXT_shader_64bit_indexing\""
    );
    let annotations = format!("OpExecutionMode %main Shader64BitIndexingEXT\n{ANNOTATIONS}");
    let shader = Shader { capabilities: &capabilities, annotations: &annotations, ..shader(body) };
    let all = shader.run_with(&mut resources).unwrap_or_else(|error| panic!("{}", error.render()));
    assert_eq!(all[1][..2], [20, 10]);
    let narrow = Shader { capabilities: CAPABILITIES, annotations: ANNOTATIONS, ..shader };
    let error = narrow.run_with(&mut resources).expect_err("a length of 64 bits");
    assert!(error.message().contains("a length of 64 bits instead of 32"), "{}", error.render());
}

#[test]
fn untyped_pointers_are_values() {
    let shader = Shader {
        functions: "
            %read = OpFunction %uint None %uint_of_pointer
            %pointer = OpFunctionParameter %untyped
            %read_entry = OpLabel
            %read_value = OpLoad %uint %pointer
            OpReturnValue %read_value
            OpFunctionEnd",
        declarations: &format!("{DECLARATIONS}\n%uint_of_pointer = OpTypeFunction %uint %untyped"),
        ..shader(
            "
            %is_odd = OpIEqual %bool %id %u1
            %seven = OpUntypedAccessChainKHR %untyped %words %a %u0 %u16
            %ten = OpUntypedAccessChainKHR %untyped %words %a %u0 %u19
            %chosen = OpSelect %untyped %is_odd %ten %seven
            %chosen_word = OpLoad %uint %chosen
            out 0 %chosen_word
            %called = OpFunctionCall %uint %read %chosen
            out 1 %called
            OpSelectionMerge %joined None
            OpBranchConditional %is_odd %odd %even
            %odd = OpLabel
            OpBranch %joined
            %even = OpLabel
            OpBranch %joined
            %joined = OpLabel
            %either = OpPhi %untyped %seven %odd %ten %even
            %either_pair = OpLoad %uint %either
            out 2 %either_pair",
        )
    };
    let all = shader.run_with(&mut resources).unwrap_or_else(|error| panic!("{}", error.render()));
    assert_eq!([&all[0][..3], &all[1][..3]], [[7, 7, 10], [10, 10, 7]]);
}

/// Each invocation adds to a word of its own.
#[test]
fn atomics_access_the_type_of_their_result() {
    let words = run("
        %place = OpIAdd %uint %out_base %u3
        %pointer = OpUntypedAccessChainKHR %untyped %out_block %out %u0 %place
        %before = OpAtomicIAdd %uint %pointer %u1 %u0 %u5
        %stored = OpAtomicExchange %uint %pointer %u1 %u0 %u9
        out 0 %before
        out 1 %stored
        OpAtomicStore %pointer %u1 %u0 %u11
        %loaded = OpAtomicLoad %uint %pointer %u1 %u0
        out 2 %loaded");
    assert_eq!(words[..4], [0, 5, 11, 11]);
}

#[test]
fn memory_is_copied_by_type_and_by_size() {
    let words = run("
        %from = OpUntypedAccessChainKHR %untyped %words %a %u0 %u17
        %place = OpIAdd %uint %out_base %u2
        %typed = OpAccessChain %ptr_StorageBuffer_uint %out %u0 %place
        OpCopyMemory %typed %from
        %behind = OpIAdd %uint %out_base %u3
        %to = OpUntypedAccessChainKHR %untyped %out_block %out %u0 %behind
        OpCopyMemorySized %to %from %u6
        %last = OpIAdd %uint %out_base %u5
        %untyped_last = OpUntypedAccessChainKHR %untyped %out_block %out %u0 %last
        OpCopyMemory %untyped_last %typed");
    // Of the words 8 and 9 six bytes.
    assert_eq!(words[2..6], [8, 8, 9, 8]);
}

/// A variable that is an array of blocks is indexed as what it is.
#[test]
fn an_element_of_an_array_of_blocks_is_a_block() {
    let shader = Shader {
        annotations: &format!(
            "{ANNOTATIONS}\nOpDecorate %blocks DescriptorSet 0\nOpDecorate %blocks Binding 2"
        ),
        declarations: &format!(
            "{DECLARATIONS}
             %two_blocks = OpTypeArray %words %u2
             %blocks = OpUntypedVariableKHR %untyped StorageBuffer %two_blocks"
        ),
        ..shader(
            "
            %which = OpBitwiseAnd %uint %id %u1
            %one = OpUntypedAccessChainKHR %untyped %two_blocks %blocks %which %u0 %u1
            %word = OpLoad %uint %one
            out 0 %word
            %block = OpUntypedAccessChainKHR %untyped %two_blocks %blocks %which
            %count = OpUntypedArrayLengthKHR %uint %words %block 0
            out 1 %count",
        )
    };
    let block = |words: &[u32]| {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        Descriptor::Buffer(Buffer::new(&bytes))
    };
    let mut both = || {
        let mut resources = resources();
        for (element, words) in (0..).zip([&[1, 2][..], &[3, 4, 5]]) {
            resources.insert(Binding { set: 0, binding: 2 }, element, block(words));
        }
        resources
    };
    let all = shader.run_with(&mut both).unwrap_or_else(|error| panic!("{}", error.render()));
    assert_eq!([&all[0][..2], &all[1][..2]], [[2, 2], [4, 3]]);
    let whole = shader.body.replace("%two_blocks %blocks %which %u0 %u1", "%words %blocks %u0 %u1");
    let error = Shader { body: &whole, ..shader }.run_with(&mut both).expect_err("a block");
    assert!(error.message().contains("an array of descriptors is accessed as"), "{}", error.render());
}

/// Variables in workgroup memory that have a layout of their own, among them two that are aliased.
#[test]
fn workgroup_memory_has_the_layout_of_its_types() {
    let compute = Workgroup {
        size: 4,
        capabilities: "
            OpCapability UntypedPointersKHR
            OpCapability WorkgroupMemoryExplicitLayoutKHR
            OpExtension \"SPV_KHR_untyped_pointers\"
            OpExtension \"SPV_KHR_workgroup_memory_explicit_layout\"",
        interface: "%first %second %shared %same",
        annotations: "
            OpDecorate %four ArrayStride 4
            OpDecorate %shared Aliased
            OpDecorate %same Aliased",
        declarations: "
            %four = OpTypeArray %uint %4
            %workgroup = OpTypeUntypedPointerKHR Workgroup
            %first = OpUntypedVariableKHR %workgroup Workgroup %four
            %second = OpUntypedVariableKHR %workgroup Workgroup %four
            %shared = OpUntypedVariableKHR %workgroup Workgroup %four
            %same = OpUntypedVariableKHR %workgroup Workgroup %four",
        body: "
            %in_first = OpUntypedAccessChainKHR %workgroup %four %first %i
            %in_second = OpUntypedAccessChainKHR %workgroup %four %second %i
            %in_shared = OpUntypedAccessChainKHR %workgroup %four %shared %i
            %in_same = OpUntypedAccessChainKHR %workgroup %four %same %i
            OpStore %in_same %9
            OpStore %in_first %1
            OpStore %in_second %2
            OpStore %in_shared %4
            OpControlBarrier %2 %2 %264
            %a = OpLoad %uint %in_first
            %b = OpLoad %uint %in_second
            %c = OpLoad %uint %in_same
            %ab = OpShiftLeftLogical %uint %a %8
            %with_b = OpBitwiseOr %uint %ab %b
            %abc = OpShiftLeftLogical %uint %with_b %8
            %all = OpBitwiseOr %uint %abc %c
            %pointer = OpAccessChain %ptr_uint %out %0 %g
            OpStore %pointer %all",
        ..Workgroup::default()
    }
    .compute();
    let out = Buffer::zeroed(16);
    let resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
    compute.run(&resources, [1, 1, 1], RunOptions::default()).expect("a dispatch");
    assert_eq!(bytemuck::pod_collect_to_vec::<u8, u32>(&out.bytes()), [0x0001_0204; 4]);
}

#[test]
fn what_breaks_a_rule_is_refused() {
    for (body, message) in [
        ("%p = OpUntypedAccessChainKHR %untyped %words %a %u1", "index 1 is out of range"),
        ("%p = OpUntypedAccessChainKHR %untyped %u1 %a %u0", "expected a type"),
        ("%p = OpUntypedAccessChainKHR %untyped %words %u1 %u0", "expected a pointer"),
        ("%p = OpUntypedPtrAccessChainKHR %untyped %uint %a %u1", "has no ArrayStride decoration"),
        ("OpCopyMemory %a %a", "OpCopyMemory between untyped pointers"),
        ("%p = OpLoad %mat %a", "a buffer's matrix has no MatrixStride decoration"),
    ] {
        let error = shader(body).run_with(&mut resources).expect_err(body);
        assert_eq!(error.kind(), ErrorKind::InvalidModule, "{body}: {}", error.render());
        assert!(error.message().contains(message), "{body}: {}", error.render());
    }
    let error =
        shader("%two = OpCopyObject %uint %id\nOpCopyMemorySized %a %a %two").run_with(&mut resources);
    let error = error.expect_err("a size that is not constant");
    assert_eq!(error.kind(), ErrorKind::UnsupportedModule, "{}", error.render());
}

/// A report names what the base type calls the member.
#[test]
fn accesses_out_of_bounds_name_the_members_of_the_base_type() {
    let annotations = format!("OpName %a \"scene\"\nOpMemberName %pairs 0 \"ranges\"\n{ANNOTATIONS}");
    let body = "%far = OpIMul %uint %id %u16
        %p = OpUntypedAccessChainKHR %untyped %pairs %a %u0 %far
        %pair = OpLoad %uint2 %p
        %x = OpCompositeExtract %uint %pair 0
        out 0 %x";
    let error =
        Shader { annotations: &annotations, ..shader(body) }.run_with(&mut resources).expect_err("a trap");
    let report = error.render();
    assert!(report.contains("scene.ranges") && report.contains("index 16"), "{report}");
}
