//! What shaders print, and their clock.

use std::sync::Arc;

use anyhit::machine::{Printed, Resources};

use crate::run::{INVOCATIONS, Shader};

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
