//! What shaders print, and their clock.

use std::sync::Arc;

use anyhit_base::error::{Error, Place};
use anyhit_engine::machine::{Buffer, Descriptor, Printed, Resources};

use crate::execution::instructions::run::{INVOCATIONS, Shader};

#[test]
fn texts_are_collected_in_launch_order() {
    let mut sinks = Vec::new();
    let shader = Shader {
        annotations: "
            %format = OpString \"id %u of %v3u: %.2f\"
            %odd = OpString \"odd\"",
        declarations: "%quarter = OpConstant %float 0.25",
        body: "
            %float_id = OpConvertUToF %float %id
            %product = OpFMul %float %float_id %quarter
            %a = OpExtInst %void %printf 1 %format %id %launch_id_value %product
            %rest = OpUMod %uint %id %u2
            %is_odd = OpINotEqual %bool %rest %u0
            OpSelectionMerge %end None
            OpBranchConditional %is_odd %yes %end
            %yes = OpLabel
            %b = OpExtInst %void %printf 1 %odd
            OpBranch %end
            %end = OpLabel",
        ..Shader::default()
    };
    shader
        .run_with(&mut || {
            let printed = Arc::new(Printed::default());
            sinks.push(printed.clone());
            Resources { printed: Some(printed), ..Resources::default() }
        })
        .unwrap_or_else(|error| panic!("{}", error.render()));
    let mut expected = Vec::new();
    for id in 0..INVOCATIONS {
        expected.push(format!("id {id} of {id}, 0, 0: {:.2}", id as f64 / 4.0));
        if id % 2 == 1 {
            expected.push("odd".to_owned());
        }
    }
    assert_eq!(sinks.len(), 6);
    for sink in sinks {
        assert_eq!(sink.take().into_iter().map(|line| line.text).collect::<Vec<_>>(), expected);
    }
}

#[test]
fn the_clock_counts_the_instructions_of_each_invocation() {
    // A loop of %id rounds between two readings: each round costs the same, at every width.
    let found = Shader {
        capabilities: "OpCapability ShaderClockKHR",
        body: "
            %start = OpReadClockKHR %ulong %u3
            OpBranch %loop
            %loop = OpLabel
            %i = OpPhi %uint %u0 %entry %more %continue
            %goes = OpULessThan %bool %i %id
            OpLoopMerge %done %continue None
            OpBranchConditional %goes %continue %done
            %continue = OpLabel
            %more = OpIAdd %uint %i %u1
            OpBranch %loop
            %done = OpLabel
            %end = OpReadClockKHR %uint2 %u3
            %end_low = OpCompositeExtract %uint %end 0
            %start_low = OpUConvert %uint %start
            %spent = OpISub %uint %end_low %start_low
            out 0 %spent",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        // A branch to the loop; OpPhi to OpBranchConditional (4), the continue block (2) for each
        // round; the header once more; the second reading itself.
        assert_eq!(words[0], 1 + 6 * id as u32 + 4 + 1, "invocation {id}");
    }
}

/// Arrays of the invocation, and a buffer of 16 words at binding 1, two of them at binding 2.
const ARRAYS: &str = "
    OpName %table \"table\"
    OpName %grid \"grid\"
    OpName %corner \"corner\"
    OpName %state \"state\"
    OpMemberName %state_type 1 \"values\"
    OpName %cells \"cells\"
    OpName %blocks \"blocks\"
    OpMemberName %cell_block 0 \"head\"
    OpMemberName %cell_block 1 \"words\"
    OpDecorate %pair ArrayStride 4
    OpDecorate %cell_block Block
    OpMemberDecorate %cell_block 0 Offset 0
    OpMemberDecorate %cell_block 1 Offset 8
    OpDecorate %cells DescriptorSet 0
    OpDecorate %cells Binding 1
    OpDecorate %blocks DescriptorSet 0
    OpDecorate %blocks Binding 2";
const ARRAY_DECLARATIONS: &str = "
    %pair = OpTypeArray %uint %u2
    %four = OpTypeArray %uint %u4
    %rows = OpTypeArray %four %u3
    %state_type = OpTypeStruct %uint %four
    %cell_block = OpTypeStruct %pair %out_words
    %two_blocks = OpTypeArray %cell_block %u2
    %ptr_four = OpTypePointer Private %four
    %ptr_rows = OpTypePointer Private %rows
    %ptr_corner = OpTypePointer Private %uint3
    %ptr_state = OpTypePointer Private %state_type
    %ptr_cells = OpTypePointer StorageBuffer %cell_block
    %ptr_blocks = OpTypePointer StorageBuffer %two_blocks
    %table = OpVariable %ptr_four Private
    %grid = OpVariable %ptr_rows Private
    %corner = OpVariable %ptr_corner Private
    %state = OpVariable %ptr_state Private
    %cells = OpVariable %ptr_cells StorageBuffer
    %blocks = OpVariable %ptr_blocks StorageBuffer";

fn trapped(annotations: &str, body: &str, functions: &str) -> Error {
    let shader = Shader {
        annotations: &format!("{annotations}{ARRAYS}"),
        declarations: ARRAY_DECLARATIONS,
        body,
        functions,
        ..Shader::default()
    };
    let buffer = || Descriptor::Buffer(Buffer::zeroed(64));
    let error = shader.run_with(&mut || {
        let mut resources = Resources::default().bind(0, 1, buffer());
        for element in 0..2 {
            resources.insert(anyhit_engine::machine::Binding { set: 0, binding: 2 }, element, buffer());
        }
        resources
    });
    error.expect_err(body)
}

#[test]
fn an_index_outside_its_array_is_told_with_array_and_length() {
    for (body, expected) in [
        (
            "%p = OpAccessChain %ptr_Private_uint %table %id\nOpStore %p %u1",
            "index 4 of `table`, which has 4 elements",
        ),
        (
            "%far = OpIAdd %uint %id %u9\n%p = OpAccessChain %ptr_Private_uint %state %u1 %far\nOpStore %p %u1",
            "index 9 of `state.values`, which has 4 elements",
        ),
        (
            "%p = OpAccessChain %ptr_Private_uint %grid %id %u1\nOpStore %p %u1",
            "index 3 of `grid`, which has 3 elements",
        ),
        (
            "%p = OpAccessChain %ptr_Private_uint %grid %u1 %id\nOpStore %p %u1",
            "index 4 of `grid[1]`, which has 4 elements",
        ),
        (
            "%row = OpAccessChain %ptr_four %grid %u2\n%p = OpAccessChain %ptr_Private_uint %row %id\nOpStore %p %u1",
            "index 4 of `grid[2]`, which has 4 elements",
        ),
        (
            "%low = OpBitwiseAnd %uint %id %u1
             %p = OpAccessChain %ptr_Private_uint %grid %low %id
             %v = OpLoad %uint %p
             out 0 %v",
            "index 4 of `grid[]`, which has 4 elements",
        ),
        (
            "%before = OpISub %uint %id %u1
             %signed = OpBitcast %int %before
             %p = OpAccessChain %ptr_Private_uint %table %signed
             OpStore %p %u1",
            "index -1 of `table`, which has 4 elements",
        ),
        (
            "%p = OpAccessChain %ptr_Private_uint %corner %id\nOpStore %p %u1",
            "index 3 of `corner`, which has 3 components",
        ),
        (
            "%v = OpVectorExtractDynamic %uint %launch_id_value %id\nout 0 %v",
            "index 3 of a vector, which has 3 components",
        ),
        (
            "%p = OpAccessChain %ptr_StorageBuffer_uint %cells %u0 %id\nOpStore %p %u1",
            "index 2 of `cells.head`, which has 2 elements",
        ),
        // 64 bytes, of which the first 8 are the head's.
        (
            "%p = OpAccessChain %ptr_StorageBuffer_uint %cells %u1 %id\nOpStore %p %u1",
            "index 14 of `cells.words`, which has 14 elements in this buffer",
        ),
        (
            "%before = OpISub %uint %id %u1
             %signed = OpBitcast %int %before
             %p = OpAccessChain %ptr_StorageBuffer_uint %cells %u1 %signed
             OpStore %p %u1",
            "index -1 of `cells.words`, which has 14 elements in this buffer",
        ),
        (
            "%p = OpAccessChain %ptr_StorageBuffer_uint %blocks %id %u0 %u0\nOpStore %p %u1",
            "index 2 of `blocks`, which has 2 elements",
        ),
        // Both are outside: the one that is followed is told, not the one that was computed last.
        (
            "%far = OpIAdd %uint %id %u8
             %p = OpAccessChain %ptr_Private_uint %table %far
             %q = OpAccessChain %ptr_Private_uint %corner %id
             %r = OpAccessChain %ptr_Private_uint %state %u1 %far
             OpStore %p %u1
             OpStore %q %u1
             OpStore %r %u1",
            "index 8 of `table`, which has 4 elements",
        ),
        // Outside in every round of the loop, but followed in the last, whose index is 6.
        (
            "OpBranch %loop
             %loop = OpLabel
             %i = OpPhi %uint %u4 %entry %next %continue
             %p = OpAccessChain %ptr_Private_uint %table %i
             %next = OpIAdd %uint %i %u1
             %going = OpULessThan %bool %i %u6
             OpLoopMerge %done %continue None
             OpBranchConditional %going %continue %done
             %continue = OpLabel
             OpBranch %loop
             %done = OpLabel
             OpStore %p %u1",
            "index 6 of `table`, which has 4 elements",
        ),
    ] {
        let error = trapped("", body, "");
        assert!(error.notes().iter().any(|note| note == expected), "{body}: {}", error.render());
    }
}

#[test]
fn an_instruction_without_a_line_is_near_one() {
    const FILE: &str = "%file = OpString \"a.rgen\"";
    let access = "%p = OpAccessChain %ptr_Private_uint %table %id\nOpStore %p %u1";
    let line = |error: &Error| {
        error.places().find_map(|(place, label)| match place {
            Place::Line { line, .. } => Some((*line, label.to_owned())),
            _ => None,
        })
    };
    let near = |line| Some((line, format!("near a.rgen:{line}: the instruction has no line information")));
    let of_its_own = trapped(FILE, &format!("OpLine %file 7 3\n{access}\nOpNoLine"), "");
    assert_eq!(line(&of_its_own), Some((7, String::new())));
    let body =
        "OpLine %file 6 1\n%a = OpIAdd %uint %id %u1\nOpLine %file 7 3\n%b = OpIAdd %uint %id %u1\nOpNoLine";
    let after = trapped(FILE, &format!("{body}\n{access}"), "");
    assert_eq!(line(&after), near(7));
    assert!(after.render().contains("near a.rgen:7"), "{}", after.render());
    // The block has a line, but only behind it; the one before it has one.
    let other_block =
        trapped(FILE, &format!("{body}\nOpBranch %next\n%next = OpLabel\n{access}\nOpLine %file 9 1"), "");
    assert_eq!(line(&other_block), near(7));
    // The lines of another function say nothing, but that of the call.
    let call = "OpLine %file 7 3\n%c = OpFunctionCall %void %helper";
    let helper = format!(
        "%helper = OpFunction %void None %main_type
         %helper_label = OpLabel
         %id_again = OpLoad %uint3 %launch_id
         %again = OpCompositeExtract %uint %id_again 0
         {}
         OpReturn
         OpFunctionEnd",
        access.replace("%id", "%again")
    );
    let elsewhere = trapped(FILE, call, &helper);
    assert_eq!(line(&elsewhere), Some((7, String::new())), "{}", elsewhere.render());
    assert_eq!(line(&trapped("", access, "")), None);
}

#[test]
fn a_missing_descriptor_is_told_with_those_that_are_bound() {
    let shader = Shader {
        annotations: "
            OpName %one \"one\"
            OpName %other \"other\"
            OpDecorate %one DescriptorSet 0
            OpDecorate %one Binding 3
            OpDecorate %other DescriptorSet 1
            OpDecorate %other Binding 0",
        declarations: "
            %one = OpVariable %ptr_StorageBuffer_out_block StorageBuffer
            %other = OpVariable %ptr_StorageBuffer_out_block StorageBuffer",
        body: "
            %p = OpAccessChain %ptr_StorageBuffer_uint %one %u0 %u0
            %q = OpAccessChain %ptr_StorageBuffer_uint %other %u0 %u0
            OpStore %p %u1
            OpStore %q %u1",
        ..Shader::default()
    };
    let buffer = || Descriptor::Buffer(Buffer::zeroed(64));
    let error = shader.run_with(&mut || Resources::default().bind(0, 3, buffer()).bind(0, 4, buffer()));
    let error = error.expect_err("a binding is missing");
    assert_eq!(
        error.notes()[..3],
        [
            "4 bytes at offset 0 of `other` (set 1, binding 0, element 0)",
            "bound: set 0, binding 0 (a buffer); set 0, binding 3 (`one`, a buffer); set 0, binding 4 (a buffer)",
            "not bound: `other` (set 1, binding 0, storage_buffer)"
        ]
    );
}

/// What stands before an instruction: up to four of an `OpLine`, an `OpNoLine` and a new block, in
/// every order; beside it the line that is in force behind them, and the last one.
fn line_instructions() -> Vec<(String, Option<u32>, Option<u32>)> {
    let mut all = Vec::new();
    for length in 0..=4 {
        for sequence in 0..3u32.pow(length) {
            let (mut text, mut in_force, mut last) = (String::new(), None, None);
            for at in 0..length {
                // SPIR-V, OpLine: up to "the next end of block, the next OpLine instruction, or the
                // next OpNoLine instruction".
                in_force = None;
                match sequence / 3u32.pow(at) % 3 {
                    0 => {
                        let line = 10 + at;
                        text += &format!("OpLine %file {line} 1\n");
                        (in_force, last) = (Some(line), Some(line));
                    }
                    1 => text += "OpNoLine\n",
                    _ => text += &format!("OpBranch %b{at}\n%b{at} = OpLabel\n"),
                }
            }
            all.push((text, in_force, last));
        }
    }
    all
}

const FILE: &str = "%file = OpString \"b.rgen\"";

#[test]
fn a_trap_has_the_line_in_force_or_the_last_one_of_its_function() {
    for (lines, in_force, last) in line_instructions() {
        let body = format!("%p = OpAccessChain %ptr_Private_uint %table %u9\n{lines}OpStore %p %u1");
        let error = trapped(FILE, &body, "");
        let found = error.places().find_map(|(place, label)| match place {
            Place::Line { line, .. } => Some((*line, label)),
            _ => None,
        });
        let label = match (in_force, last) {
            (None, Some(line)) => format!("near b.rgen:{line}: the instruction has no line information"),
            _ => String::new(),
        };
        assert_eq!(found, in_force.or(last).map(|line| (line, &*label)), "{body}");
        // The word of the module stands there in any case.
        assert!(error.places().any(|(place, _)| matches!(place, Place::Word(_))), "{body}");
    }
}

#[test]
fn a_call_has_the_line_in_force_or_the_last_one_of_its_function() {
    let helper = "
        %helper = OpFunction %void None %main_type
        %helper_label = OpLabel
        %p = OpAccessChain %ptr_Private_uint %table %u9
        OpStore %p %u1
        OpReturn
        OpFunctionEnd";
    for (lines, in_force, last) in line_instructions() {
        let body = format!("{lines}%call = OpFunctionCall %void %helper");
        let error = trapped(FILE, &body, helper);
        let notes = error.notes().join("\n");
        match (in_force, last) {
            (Some(line), _) => {
                assert!(notes.contains(&format!("called at b.rgen:{line}")), "{body}: {notes}")
            }
            (None, Some(line)) => {
                assert!(notes.contains(&format!("called near b.rgen:{line}")), "{body}: {notes}");
            }
            (None, None) => assert!(!notes.contains("b.rgen"), "{body}: {notes}"),
        }
    }
}

#[test]
fn elements_of_arrays_in_blocks_are_counted_from_their_own_beginning() {
    // A head of 8 bytes, then 14 words in each of the two buffers of 64 bytes.
    for (body, expected) in [
        (
            "%p = OpAccessChain %ptr_StorageBuffer_uint %blocks %u1 %u1 %id\nOpStore %p %u1",
            "index 14 of `blocks[1].words`, which has 14 elements in this buffer",
        ),
        (
            "%odd = OpBitwiseAnd %uint %id %u1
             %p = OpAccessChain %ptr_StorageBuffer_uint %blocks %odd %u1 %id
             %v = OpLoad %uint %p
             out 0 %v",
            "index 14 of `blocks[].words`, which has 14 elements in this buffer",
        ),
        (
            "%far = OpIAdd %uint %id %u20
             %p = OpAccessChain %ptr_StorageBuffer_uint %blocks %u0 %u1 %far
             %v = OpAtomicIAdd %uint %p %u1 %u0 %u1",
            "index 20 of `blocks[0].words`, which has 14 elements in this buffer",
        ),
        (
            "%p = OpAccessChain %ptr_StorageBuffer_uint %cells %u1 %id
             %v = OpAtomicExchange %uint %p %u1 %u0 %u1",
            "index 14 of `cells.words`, which has 14 elements in this buffer",
        ),
        (
            "%p = OpAccessChain %ptr_StorageBuffer_uint %blocks %u1 %u0 %id
             %v = OpAtomicOr %uint %p %u1 %u0 %u1",
            "index 2 of `blocks[1].head`, which has 2 elements",
        ),
    ] {
        let error = trapped("", body, "");
        assert!(error.notes().iter().any(|note| note == expected), "{body}: {}", error.render());
    }
}
