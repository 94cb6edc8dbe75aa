//! Loops whose invocations turn differently often.

use crate::execution::instructions::run::Shader;

/// The value that a phi behind a loop takes from the block that goes back: each invocation keeps
/// that of its own last turn, while others go round again.
#[test]
fn a_phi_behind_a_loop_has_the_value_of_the_last_turn() {
    let found = Shader {
        body: "
            %tripled = OpVariable %ptr_Function_uint Function
            OpStore %tripled %u1
            %bound = OpBitwiseAnd %uint %id %u3
            OpBranch %header
            %header = OpLabel
            %turn = OpPhi %uint %u0 %entry %next %latch
            OpLoopMerge %merge %latch None
            OpBranch %latch
            %latch = OpLabel
            %before = OpLoad %uint %tripled
            %after = OpIMul %uint %before %u3
            OpStore %tripled %after
            %next = OpIAdd %uint %turn %u1
            %more = OpULessThan %bool %next %bound
            OpBranchConditional %more %header %merge
            %merge = OpLabel
            %last = OpPhi %uint %before %latch
            out 0 %last",
        ..Shader::default()
    }
    .run();
    for (id, words) in found.iter().enumerate() {
        // 1 is tripled as often as the bound says, but once at least; the phi has what it was
        // before the last time.
        assert_eq!(words[0], 3u32.pow((id as u32 & 3).max(1) - 1), "invocation {id}");
    }
}

/// The trap that ends an endless loop is the same with and without the optimizer where the loop's
/// last instruction is a load that the optimizer eliminates: only what that load itself might have
/// trapped at is not told.
#[test]
fn an_endless_loop_with_a_load_that_nobody_reads_ends_in_its_trap() {
    let trap = Shader {
        body: "
            OpBranch %header
            %header = OpLabel
            OpLoopMerge %merge %latch None
            OpBranch %latch
            %latch = OpLabel
            %pointer = OpAccessChain %ptr_StorageBuffer_uint %out %u0 %u0
            %unread = OpLoad %uint %pointer
            OpBranch %header
            %merge = OpLabel",
        fuel: Some(1000),
        ..Shader::default()
    }
    .refused();
    assert!(trap.render().contains("ran out of fuel"), "{}", trap.render());
}
