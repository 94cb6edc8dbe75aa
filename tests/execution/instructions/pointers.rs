//! Pointers as values (`VariablePointers`): through phis, selects and calls, into matrices too.

use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::{Buffer, Descriptor, Resources};

use crate::execution::instructions::run::Shader;

/// Two blocks { mat2x3 rows (row-major), mat2x3 columns, uint words[4] } at bindings 1 and 2: a
/// mat2x3 has two columns of three components.
const LAYOUT: &str = "
    OpDecorate %block Block
    OpMemberDecorate %block 0 Offset 0
    OpMemberDecorate %block 0 RowMajor
    OpMemberDecorate %block 0 MatrixStride 8
    OpMemberDecorate %block 1 Offset 32
    OpMemberDecorate %block 1 ColMajor
    OpMemberDecorate %block 1 MatrixStride 16
    OpMemberDecorate %block 2 Offset 64
    OpDecorate %words ArrayStride 4
    OpDecorate %ptr_word ArrayStride 4
    OpDecorate %a DescriptorSet 0
    OpDecorate %a Binding 1
    OpDecorate %b DescriptorSet 0
    OpDecorate %b Binding 2";
const DECLARATIONS: &str = "
    %mat = OpTypeMatrix %float3 2
    %words = OpTypeArray %uint %u4
    %block = OpTypeStruct %mat %mat %words
    %ptr_block = OpTypePointer StorageBuffer %block
    %ptr_mat = OpTypePointer StorageBuffer %mat
    %ptr_column = OpTypePointer StorageBuffer %float3
    %ptr_float = OpTypePointer StorageBuffer %float
    %ptr_word = OpTypePointer StorageBuffer %uint
    %a = OpVariable %ptr_block StorageBuffer
    %b = OpVariable %ptr_block StorageBuffer
    %uint_of_mat = OpTypeFunction %uint %ptr_mat
    %uint_of_column = OpTypeFunction %uint %ptr_column
    %column_of_bool = OpTypeFunction %ptr_column %bool
    %eight = OpConstant %float 8.0
    %eights = OpConstantComposite %float3 %eight %eight %eight";
const CAPABILITIES: &str = "OpCapability VariablePointers";

/// Block `a` holds 0, 1, 2, ... as floats in its first 16 words, block `b` 100 more; the words of
/// `a` are 7, 8, 9, 10, those of `b` 17 to 20.
fn blocks() -> Resources {
    let block = |float: f32, word: u32| {
        let floats = (0..16).map(|at| (float + at as f32).to_bits());
        let bytes: Vec<u8> = floats.chain(word..word + 4).flat_map(u32::to_le_bytes).collect();
        Descriptor::Buffer(Buffer::new(&bytes))
    };
    Resources::default().bind(0, 1, block(0.0, 7)).bind(0, 2, block(100.0, 17))
}

fn run(body: &str, functions: &str) -> Vec<[u32; 16]> {
    let shader = Shader {
        capabilities: CAPABILITIES,
        annotations: LAYOUT,
        declarations: DECLARATIONS,
        body: &format!(
            "%odd_word = OpBitwiseAnd %uint %id %u1
             %odd = OpIEqual %bool %odd_word %u1
             {body}"
        ),
        functions,
        ..Shader::default()
    };
    shader.run_with(&mut blocks).unwrap_or_else(|error| panic!("{}", error.render()))
}

#[test]
fn columns_of_row_major_matrices_come_through_phis_and_selects() {
    let found = run(
        "OpSelectionMerge %merge None
         OpBranchConditional %odd %then %merge
         %then = OpLabel
         %in_b = OpAccessChain %ptr_column %b %u0 %u1
         OpBranch %merge
         %merge = OpLabel
         %first = OpAccessChain %ptr_column %a %u0 %u1
         %other = OpAccessChain %ptr_column %b %u0 %u1
         %chosen = OpSelect %ptr_column %odd %other %first
         %column = OpLoad %float3 %chosen
         %y = OpCompositeExtract %float %column 1
         %y_word = OpConvertFToU %uint %y
         out 0 %y_word
         %z_pointer = OpAccessChain %ptr_float %chosen %u2
         %z = OpLoad %float %z_pointer
         %z_word = OpConvertFToU %uint %z
         out 1 %z_word
         %same = OpPtrEqual %bool %chosen %first
         %same_word = OpSelect %uint %same %u1 %u0
         out 2 %same_word",
        "",
    );
    // Row-major with 8 bytes from row to row: component r of column 1 is float 2 r + 1.
    for (id, words) in found.iter().enumerate() {
        let base = if id % 2 == 1 { 100 } else { 0 };
        assert_eq!(words[..3], [base + 3, base + 5, u32::from(id % 2 == 0)]);
    }
}

#[test]
fn a_phi_of_matrices_keeps_their_layout() {
    let found = run(
        "OpSelectionMerge %merge None
         OpBranchConditional %odd %then %else
         %then = OpLabel
         %in_b = OpAccessChain %ptr_mat %b %u1
         OpBranch %merge
         %else = OpLabel
         %in_a = OpAccessChain %ptr_mat %a %u1
         OpBranch %merge
         %merge = OpLabel
         %chosen = OpPhi %ptr_mat %in_b %then %in_a %else
         %whole = OpLoad %mat %chosen
         %x = OpCompositeExtract %float %whole 1 0
         %x_word = OpConvertFToU %uint %x
         out 0 %x_word
         %y_pointer = OpAccessChain %ptr_float %chosen %odd_word %u1
         %y = OpLoad %float %y_pointer
         %y_word = OpConvertFToU %uint %y
         out 1 %y_word",
        "",
    );
    // Column-major at 32 with 16 bytes from column to column: component r of column c is float 8 +
    // 4 c + r.
    for (id, words) in found.iter().enumerate() {
        let odd = id as u32 % 2;
        assert_eq!(words[..2], [100 * odd + 12, 100 * odd + 8 + 4 * odd + 1]);
    }
}

#[test]
fn functions_take_and_give_pointers_into_matrices() {
    let found = run(
        "%in_a = OpAccessChain %ptr_mat %a %u0
         %in_b = OpAccessChain %ptr_mat %b %u0
         %m = OpFunctionCall %uint %of_mat %in_a
         out 0 %m
         %n = OpFunctionCall %uint %of_mat %in_b
         out 1 %n
         %column_pointer = OpFunctionCall %ptr_column %choose %odd
         %p = OpFunctionCall %uint %of_column %column_pointer
         out 2 %p",
        "%of_mat = OpFunction %uint None %uint_of_mat
         %given = OpFunctionParameter %ptr_mat
         %of_mat_label = OpLabel
         %of_mat_pointer = OpAccessChain %ptr_float %given %u1 %u2
         %of_mat_value = OpLoad %float %of_mat_pointer
         %of_mat_word = OpConvertFToU %uint %of_mat_value
         OpReturnValue %of_mat_word
         OpFunctionEnd
         %of_column = OpFunction %uint None %uint_of_column
         %given_column = OpFunctionParameter %ptr_column
         %of_column_label = OpLabel
         %of_column_value = OpLoad %float3 %given_column
         %of_column_y = OpCompositeExtract %float %of_column_value 1
         %of_column_word = OpConvertFToU %uint %of_column_y
         OpReturnValue %of_column_word
         OpFunctionEnd
         %choose = OpFunction %ptr_column None %column_of_bool
         %which = OpFunctionParameter %bool
         %choose_label = OpLabel
         %choose_a = OpAccessChain %ptr_column %a %u0 %u0
         %choose_b = OpAccessChain %ptr_column %b %u0 %u0
         %choose_it = OpSelect %ptr_column %which %choose_b %choose_a
         OpReturnValue %choose_it
         OpFunctionEnd",
    );
    for (id, words) in found.iter().enumerate() {
        let base = if id % 2 == 1 { 100 } else { 0 };
        assert_eq!(words[..3], [5, 105, base + 2]);
    }
}

#[test]
fn a_column_is_stored_through_a_select() {
    let found = run(
        "%first = OpAccessChain %ptr_column %a %u0 %u0
         %other = OpAccessChain %ptr_column %b %u0 %u0
         %chosen = OpSelect %ptr_column %odd %other %first
         OpStore %chosen %eights
         %beside_pointer = OpAccessChain %ptr_float %a %u0 %u1 %u1
         %beside = OpLoad %float %beside_pointer
         %beside_word = OpConvertFToU %uint %beside
         out 0 %beside_word
         %mine_pointer = OpInBoundsAccessChain %ptr_float %chosen %u2
         %mine = OpLoad %float %mine_pointer
         %mine_word = OpConvertFToU %uint %mine
         out 1 %mine_word",
        "",
    );
    for words in found {
        assert_eq!(words[..2], [3, 8]);
    }
}

#[test]
fn pointers_step_through_arrays_in_loops() {
    let found = run(
        "%start_a = OpAccessChain %ptr_word %a %u2 %u0
         %start_b = OpAccessChain %ptr_word %b %u2 %u0
         %start = OpSelect %ptr_word %odd %start_b %start_a
         %end = OpInBoundsPtrAccessChain %ptr_word %start %u4
         OpBranch %loop
         %loop = OpLabel
         %here = OpPhi %ptr_word %start %entry %next %continue
         %sum = OpPhi %uint %u0 %entry %more %continue
         %going = OpPtrNotEqual %bool %here %end
         OpLoopMerge %done %continue None
         OpBranchConditional %going %continue %done
         %continue = OpLabel
         %value = OpLoad %uint %here
         %more = OpIAdd %uint %sum %value
         %next = OpPtrAccessChain %ptr_word %here %u1
         OpBranch %loop
         %done = OpLabel
         out 0 %sum
         %count = OpPtrDiff %uint %end %start
         out 1 %count",
        "",
    );
    for (id, words) in found.iter().enumerate() {
        assert_eq!(words[..2], [if id % 2 == 1 { 17 + 18 + 19 + 20 } else { 7 + 8 + 9 + 10 }, 4]);
    }
}

#[test]
fn layouts_that_differ_are_refused() {
    let shader = Shader {
        capabilities: CAPABILITIES,
        annotations: LAYOUT,
        declarations: DECLARATIONS,
        body: "
            %odd = OpIEqual %bool %id %u1
            %rows = OpAccessChain %ptr_mat %a %u0
            %columns = OpAccessChain %ptr_mat %a %u1
            %chosen = OpSelect %ptr_mat %odd %rows %columns
            %whole = OpLoad %mat %chosen",
        ..Shader::default()
    };
    let error = shader.run_with(&mut blocks).expect_err("two layouts");
    assert_eq!(error.message(), "a pointer into matrices of different layouts is not supported");
}

#[test]
fn raw_access_chains_count_bytes() {
    let found = Shader {
        capabilities: "OpCapability RawAccessChainsNV",
        annotations: LAYOUT,
        declarations: DECLARATIONS,
        body: "
            %stride = OpIAdd %uint %u8 %u0
            %low = OpBitwiseAnd %uint %id %u3
            %pointer = OpRawAccessChainNV %ptr_column %a %u8 %low %u4
            %value = OpLoad %float3 %pointer Aligned 4
            %z = OpCompositeExtract %float %value 2
            %word = OpConvertFToU %uint %z
            out 0 %word",
        ..Shader::default()
    };
    let found = found.run_with(&mut blocks).unwrap_or_else(|error| panic!("{}", error.render()));
    // Byte 8 i + 4 is float 2 i + 1; component z lies two floats further.
    for (id, words) in found.iter().enumerate() {
        assert_eq!(words[0], 2 * (id as u32 % 4) + 3);
    }
}

#[test]
fn constants_past_the_end_of_a_vector_trap_where_they_are_used() {
    // "Each index must be in bounds" is undefined behaviour of `OpAccessChain`, not a rule of the
    // module: spirv-val accepts both shaders.
    let shader = |taken: &str| {
        let body = format!(
            "%point = OpVariable %ptr_own3 Function
            %beyond = OpAccessChain %ptr_own %point %u3
            OpSelectionMerge %end None
            OpBranchConditional {taken} %yes %end
            %yes = OpLabel
            %value = OpLoad %uint %beyond
            out 0 %value
            OpBranch %end
            %end = OpLabel
            out 1 %u7"
        );
        let declarations = "%ptr_own3 = OpTypePointer Function %uint3
            %ptr_own = OpTypePointer Function %uint";
        Shader { declarations, body: &body, ..Shader::default() }.run_with(&mut Resources::default)
    };
    let found = shader("%false").unwrap_or_else(|error| panic!("{}", error.render()));
    assert!(found.iter().all(|words| words[1] == 7));
    let error = shader("%true").expect_err("a component that does not exist");
    assert_eq!(error.kind(), ErrorKind::Trap);
}

#[test]
fn inputs_are_builtins_or_have_a_location() {
    let error = |annotations: &str| {
        let declarations = "%ptr_in = OpTypePointer Input %uint\n%lonely = OpVariable %ptr_in Input";
        let body = "%value = OpLoad %uint %lonely";
        Shader { annotations, declarations, body, ..Shader::default() }.refused()
    };
    let without = error("");
    assert_eq!(without.kind(), ErrorKind::InvalidModule);
    assert_eq!(without.notes(), ["VUID-StandaloneSpirv-Location-04916"]);
    assert_eq!(error("OpDecorate %lonely Location 0").kind(), ErrorKind::UnsupportedModule);
}

#[test]
fn elements_are_counted_in_the_stride_of_their_array() {
    // Elements of eight bytes, four of them used; the pointers' type has no ArrayStride.
    let layout = "
        OpDecorate %words ArrayStride 8
        OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
        OpDecorate %a DescriptorSet 0
        OpDecorate %a Binding 1";
    let declarations = "
        %words = OpTypeArray %uint %u8
        %block = OpTypeStruct %words
        %to_block = OpTypePointer StorageBuffer %block
        %a = OpVariable %to_block StorageBuffer
        %uint_of_pointer = OpTypeFunction %uint %ptr_StorageBuffer_uint";
    let functions = "
        %from_first = OpFunction %uint None %uint_of_pointer
        %pointer = OpFunctionParameter %ptr_StorageBuffer_uint
        %start = OpLabel
        %origin = OpAccessChain %ptr_StorageBuffer_uint %a %u0 %u0
        %steps = OpPtrDiff %uint %pointer %origin
        OpReturnValue %steps
        OpFunctionEnd";
    let shader = |body: &'static str| Shader {
        capabilities: CAPABILITIES,
        annotations: layout,
        declarations,
        body,
        functions,
        ..Shader::default()
    };
    let mut resources = || Resources::default().bind(0, 1, Descriptor::Buffer(Buffer::zeroed(64)));
    let found = shader(
        "%at = OpBitwiseAnd %uint %id %u7
         %p = OpAccessChain %ptr_StorageBuffer_uint %a %u0 %at
         %q = OpAccessChain %ptr_StorageBuffer_uint %a %u0 %u2
         %there = OpPtrDiff %int %p %q
         %there_word = OpBitcast %uint %there
         out 0 %there_word
         %wide = OpPtrDiff %long %p %q
         %wide_word = OpUConvert %uint %wide
         out 1 %wide_word
         %odd_word = OpBitwiseAnd %uint %id %u1
         %odd = OpIEqual %bool %odd_word %u1
         %either = OpSelect %ptr_StorageBuffer_uint %odd %p %q
         %steps_on = OpFunctionCall %uint %from_first %either
         out 2 %steps_on",
    )
    .run_with(&mut resources)
    .unwrap_or_else(|error| panic!("{}", error.render()));
    for (id, words) in found.iter().enumerate() {
        let at = id as u32 % 8;
        let either = if id % 2 == 1 { at } else { 2 };
        assert_eq!(words[..3], [at.wrapping_sub(2), at.wrapping_sub(2), either], "invocation {id}");
    }
    // OpPtrAccessChain needs the decoration in storage buffers.
    let error = shader(
        "%p = OpAccessChain %ptr_StorageBuffer_uint %a %u0 %u0
         %q = OpPtrAccessChain %ptr_StorageBuffer_uint %p %u1
         %v = OpLoad %uint %q
         out 0 %v",
    )
    .refused();
    assert_eq!(error.kind(), anyhit::ErrorKind::InvalidModule);
    assert!(error.message().contains("ArrayStride"), "{}", error.render());
}

#[test]
fn pointers_out_of_memory_that_may_lead_into_arrays_of_several_strides_are_not_subtracted() {
    // `%out` has elements of `uint` every 4 bytes, `%a` every 8.
    let error = Shader {
        capabilities: CAPABILITIES,
        annotations: "OpDecorate %array ArrayStride 8
            OpDecorate %block Block
            OpMemberDecorate %block 0 Offset 0
            OpDecorate %a DescriptorSet 0
            OpDecorate %a Binding 1",
        declarations: "%array = OpTypeArray %uint %u8
            %block = OpTypeStruct %array
            %ptr_block = OpTypePointer StorageBuffer %block
            %ptr = OpTypePointer StorageBuffer %uint
            %ptr_kept = OpTypePointer Private %ptr
            %kept = OpVariable %ptr_kept Private
            %a = OpVariable %ptr_block StorageBuffer",
        body: "%p = OpAccessChain %ptr %a %u0 %u5
            OpStore %kept %p
            %one = OpLoad %ptr %kept
            %other = OpLoad %ptr %kept
            %distance = OpPtrDiff %int %one %other
            %word = OpBitcast %uint %distance
            out 0 %word",
        ..Shader::default()
    }
    .refused();
    assert_eq!(error.kind(), anyhit::ErrorKind::UnsupportedModule);
    assert!(error.message().contains("whose stride is ambiguous"), "{}", error.render());
}

/// Ways from `%p`, which leads to an element of `%array`, to a pointer `%way` of equal value.
const POINTER_WAYS: &[(&str, &str)] = &[
    ("itself", "%way = OpCopyObject %ptr %p"),
    ("itself, frozen", "%way = OpFreezeKHR %ptr %p"),
    ("a choice", "%way = OpSelect %ptr %odd %p %p_again"),
    ("a variable", "OpStore %kept %p\n%way = OpLoad %ptr %kept"),
    ("a parameter and a result", "%way = OpFunctionCall %ptr %same %p"),
    (
        "a phi",
        "OpSelectionMerge %merge None
         OpBranchConditional %odd %then %merge
         %then = OpLabel
         OpBranch %merge
         %merge = OpLabel
         %way = OpPhi %ptr %p %entry %p_again %then",
    ),
];

#[test]
fn distances_are_counted_in_elements_whatever_they_are_and_wherever_a_pointer_comes_from() {
    // Element types with the strides that their arrays have: tight and wide ones.
    for (element, strides) in [
        ("uint", [4, 8, 20]),
        ("ulong", [8, 16, 24]),
        ("uint2", [8, 12, 32]),
        ("item", [12, 16, 64]),
        ("row", [16, 20, 48]),
    ] {
        for stride in strides {
            for &(name, way) in POINTER_WAYS {
                let annotations = format!(
                    "OpDecorate %array ArrayStride {stride}
                     OpDecorate %row ArrayStride 4
                     OpMemberDecorate %item 0 Offset 0
                     OpMemberDecorate %item 1 Offset 4
                     OpDecorate %block Block
                     OpMemberDecorate %block 0 Offset 16
                     OpDecorate %a DescriptorSet 0
                     OpDecorate %a Binding 1"
                );
                let declarations = format!(
                    "%row = OpTypeArray %float %u4
                     %item = OpTypeStruct %uint %uint2
                     %array = OpTypeArray %{element} %u8
                     %block = OpTypeStruct %array
                     %ptr_block = OpTypePointer StorageBuffer %block
                     %ptr = OpTypePointer StorageBuffer %{element}
                     %ptr_kept = OpTypePointer Private %ptr
                     %kept = OpVariable %ptr_kept Private
                     %a = OpVariable %ptr_block StorageBuffer
                     %same_type = OpTypeFunction %ptr %ptr"
                );
                let body = format!(
                    "%at = OpBitwiseAnd %uint %id %u7
                     %odd_word = OpBitwiseAnd %uint %id %u1
                     %odd = OpIEqual %bool %odd_word %u1
                     %p = OpAccessChain %ptr %a %u0 %at
                     %p_again = OpInBoundsAccessChain %ptr %a %u0 %at
                     %q = OpAccessChain %ptr %a %u0 %u5
                     {way}
                     %there = OpPtrDiff %int %way %q
                     %back = OpPtrDiff %int %q %way
                     %there_word = OpBitcast %uint %there
                     %back_word = OpBitcast %uint %back
                     out 0 %there_word
                     out 1 %back_word"
                );
                let found = Shader {
                    capabilities: CAPABILITIES,
                    annotations: &annotations,
                    declarations: &declarations,
                    body: &body,
                    functions: "
                        %same = OpFunction %ptr DontInline %same_type
                        %given = OpFunctionParameter %ptr
                        %same_entry = OpLabel
                        OpReturnValue %given
                        OpFunctionEnd",
                    ..Shader::default()
                }
                .run_with(&mut || Resources::default().bind(0, 1, Descriptor::Buffer(Buffer::zeroed(528))));
                let found = found.unwrap_or_else(|error| panic!("{name}, {element}: {}", error.render()));
                for (id, words) in found.iter().enumerate() {
                    let at = id as u32 % 8;
                    let expected = [at.wrapping_sub(5), 5u32.wrapping_sub(at)];
                    assert_eq!(words[..2], expected, "{name}, {element} every {stride} bytes, element {at}");
                }
            }
        }
    }
}
