//! Split control barriers (`SPV_EXT_split_barrier`).

use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{BatchWidth, RunOptions};

use crate::execution::instructions::run::Shader;
use crate::execution::instructions::workgroup::Workgroup;

const CAPABILITIES: &str = "OpCapability SplitBarrierEXT\nOpExtension \"SPV_EXT_split_barrier\"";

/// What is stored before the arrival is seen behind the wait, whatever is between them.
#[test]
fn who_waits_sees_what_was_stored_before_the_others_arrived() {
    let compute = Workgroup {
        size: 96,
        capabilities: CAPABILITIES,
        interface: "%numbers",
        declarations: "
            %96 = OpConstant %uint 96
            %95 = OpConstant %uint 95
            %array = OpTypeArray %uint %96
            %ptr_array = OpTypePointer Workgroup %array
            %ptr_number = OpTypePointer Workgroup %uint
            %numbers = OpVariable %ptr_array Workgroup",
        body: "
            %own = OpAccessChain %ptr_number %numbers %i
            OpStore %own %g
            OpControlBarrierArriveINTEL %2 %2 %264
            %doubled = OpIMul %uint %g %2
            %mirrored = OpISub %uint %95 %i
            OpControlBarrierWaitINTEL %2 %2 %264
            %other = OpAccessChain %ptr_number %numbers %mirrored
            %number = OpLoad %uint %other
            %sum = OpIAdd %uint %number %doubled
            %pointer = OpAccessChain %ptr_uint %out %0 %g
            OpStore %pointer %sum",
        ..Workgroup::default()
    }
    .compute();
    for lanes in [BatchWidth::One, BatchWidth::Of64, BatchWidth::Of128] {
        let out = Buffer::zeroed(4 * 192);
        let resources = Resources::default().bind(0, 0, Descriptor::Buffer(out.clone()));
        compute.run(&resources, [2, 1, 1], RunOptions::of(lanes)).expect("a dispatch");
        let sums: Vec<u32> = bytemuck::pod_collect_to_vec(&out.bytes());
        let mirrored = |g: u32| g / 96 * 96 + 95 - g % 96;
        assert_eq!(sums, (0..192).map(|g| mirrored(g) + 2 * g).collect::<Vec<_>>());
    }
}

#[test]
fn a_split_barrier_of_a_workgroup_is_for_compute_shaders() {
    for half in ["Arrive", "Wait"] {
        let body = format!("OpControlBarrier{half}INTEL %u2 %u2 %u0");
        let error = Shader { capabilities: CAPABILITIES, body: &body, ..Shader::default() }.refused();
        assert!(error.render().contains("VUID-StandaloneSpirv-None-04637"), "{}", error.render());
    }
}
