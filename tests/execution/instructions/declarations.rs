//! Instructions of module scope: specialization constants, groups of decorations, long vectors.

use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::Resources;

use crate::execution::instructions::run::Shader;

#[test]
fn specialization_constants_have_their_defaults() {
    let found = Shader {
        capabilities: "OpCapability ReplicatedCompositesEXT",
        annotations: "
            OpDecorate %yes SpecId 1
            OpDecorate %no SpecId 2
            OpDecorate %number SpecId 3",
        declarations: "
            %yes = OpSpecConstantTrue %bool
            %no = OpSpecConstantFalse %bool
            %number = OpSpecConstant %uint 5
            %pair = OpSpecConstantComposite %uint2 %number %u3
            %same = OpSpecConstantCompositeReplicateEXT %uint3 %number
            %plain = OpConstantCompositeReplicateEXT %uint2 %u9
            %sum = OpSpecConstantOp %uint IAdd %number %u7
            %part = OpSpecConstantOp %uint CompositeExtract %pair 1
            %chosen = OpSpecConstantOp %uint Select %no %u1 %sum",
        body: "
            %yes_word = OpSelect %uint %yes %u1 %u0
            out 0 %yes_word
            %no_word = OpSelect %uint %no %u1 %u0
            out 1 %no_word
            %first = OpCompositeExtract %uint %pair 0
            out 2 %first
            %third = OpCompositeExtract %uint %same 2
            out 3 %third
            %second = OpCompositeExtract %uint %plain 1
            out 4 %second
            out 5 %sum
            out 6 %part
            out 7 %chosen",
        ..Shader::default()
    }
    .run();
    for words in found {
        assert_eq!(words[..8], [1, 0, 5, 5, 9, 12, 3, 12]);
    }
}

#[test]
fn groups_decorate_their_members() {
    let found = Shader {
        annotations: "
            OpDecorate %layout DescriptorSet 0
            OpDecorate %layout Binding 0
            %layout = OpDecorationGroup
            OpGroupDecorate %layout %again
            OpDecorate %zero_offset Offset 4
            %zero_offset = OpDecorationGroup
            OpGroupMemberDecorate %zero_offset %block 0
            OpDecorate %block Block
            OpDecorateString %again UserSemantic \"OUT\"
            OpMemberDecorateString %block 0 UserSemantic \"WORD\"
            OpModuleProcessed \"by hand\"",
        declarations: "
            %block = OpTypeStruct %uint
            %ptr_block = OpTypePointer StorageBuffer %block
            %again = OpVariable %ptr_block StorageBuffer",
        body: "
            %is_first = OpIEqual %bool %id %u0
            OpSelectionMerge %end None
            OpBranchConditional %is_first %yes %end
            %yes = OpLabel
            %pointer = OpAccessChain %ptr_StorageBuffer_uint %again %u0
            OpStore %pointer %u7
            OpBranch %end
            %end = OpLabel",
        ..Shader::default()
    }
    .run();
    // The block begins at the output's first byte: its member is word 1 of invocation 0.
    assert_eq!(found[0][..3], [0, 7, 0]);
}

#[test]
fn vectors_may_be_long() {
    let found = Shader {
        capabilities: "OpCapability LongVectorEXT\nOpExtension \"SPV_EXT_long_vector\"",
        annotations: "
            OpDecorate %long_block Block
            OpMemberDecorate %long_block 0 Offset 32
            OpDecorate %longs DescriptorSet 0
            OpDecorate %longs Binding 0",
        declarations: "
            %uint6 = OpTypeVectorIdEXT %uint %u6
            %six = OpConstantComposite %uint6 %u1 %u2 %u3 %u4 %u5 %u6
            %long_block = OpTypeStruct %uint6
            %ptr_long_block = OpTypePointer StorageBuffer %long_block
            %ptr_uint6 = OpTypePointer StorageBuffer %uint6
            %longs = OpVariable %ptr_long_block StorageBuffer",
        body: "
            %same = OpCompositeConstruct %uint6 %id %id %id %id %id %id
            %product = OpIMul %uint6 %same %six
            %sum = OpIAdd %uint6 %product %six
            %last = OpCompositeExtract %uint %sum 5
            out 0 %last
            %at = OpUMod %uint %id %u6
            %picked = OpVectorExtractDynamic %uint %sum %at
            out 1 %picked
            %put = OpVectorInsertDynamic %uint6 %sum %u20 %at
            %back = OpVectorExtractDynamic %uint %put %at
            out 2 %back
            %mixed = OpVectorShuffle %uint4 %sum %six 5 6 0 11
            %w = OpCompositeExtract %uint %mixed 3
            out 3 %w
            %is_first = OpIEqual %bool %id %u0
            OpSelectionMerge %end None
            OpBranchConditional %is_first %yes %end
            %yes = OpLabel
            %pointer = OpAccessChain %ptr_uint6 %longs %u0
            OpStore %pointer %sum
            OpBranch %end
            %end = OpLabel",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        let id = id as u32;
        assert_eq!(words[..4], [6 * id + 6, (id + 1) * (id % 6 + 1), 20, 6]);
    }
    // Stored from word 8 on: 1 to 6.
    assert_eq!(found[0][8..14], [1, 2, 3, 4, 5, 6]);
}

#[test]
fn what_says_nothing_is_read_over() {
    let found = Shader {
        capabilities: "
            OpExtension \"SPV_KHR_non_semantic_info\"
            OpExtension \"SPV_KHR_relaxed_extended_instruction\"
            %unknown = OpExtInstImport \"NonSemantic.Nobody.Knows\"
            OpSourceExtension \"GL_SOMETHING\"",
        annotations: "
            %file = OpString \"a.glsl\"
            OpSource GLSL 460 %file \"line 1\"
            OpSourceContinued \"line 2\"
            OpDecorateId %number UniformId %u3",
        declarations: "
            %number = OpSpecConstant %uint 4
            %note = OpExtInst %void %unknown 17 %number
            %forward = OpExtInstWithForwardRefsKHR %void %unknown 18 %later
            %later = OpExtInst %void %unknown 19",
        body: "
            OpLine %file 1 1
            OpNop
            OpNoLine
            %inside = OpExtInst %void %unknown 20 %id
            out 0 %number",
        ..Shader::default()
    }
    .run();
    assert!(found.iter().all(|words| words[0] == 4));
}

/// SPIR-V 3.3.8: an initializer is a constant, or a variable of module scope, and has "the same
/// type as the type pointed to by Result Type".
#[test]
fn local_variables_begin_with_constants_of_their_type() {
    let shader = |initializer: &str| {
        Shader {
            declarations: "%wide = OpConstantNull %uint4",
            variables: &format!("%local = OpVariable %ptr_Function_uint Function {initializer}"),
            body: "%value = OpLoad %uint %local\nout 0 %value",
            ..Shader::default()
        }
        .run_with(&mut Resources::default)
    };
    assert!(shader("%u9").expect("a constant of its type").iter().all(|words| words[0] == 9));
    for other in ["%wide", "%glsl", "%main", "%void"] {
        let error = shader(other).expect_err(other);
        assert_eq!(error.kind(), ErrorKind::InvalidModule, "{error}");
    }
}
