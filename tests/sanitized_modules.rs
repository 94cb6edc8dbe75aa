//! What the sanitizer tells of modules that no compiler writes.

use std::sync::Arc;

use anyhit::internals::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit::internals::pipeline::Compute;
use anyhit::internals::sanitize::{Levels, ProgramPlan, Sanitizer};

use crate::support::assembly::assemble;

/// A shader of two invocations that writes to one buffer of an array each, by an access that is
/// decorated `NonUniform`.
fn writes_to_its_own_buffer(capability: &str) -> String {
    format!(
        "OpCapability Shader
         OpCapability ShaderNonUniform
         {capability}
         OpMemoryModel Logical GLSL450
         OpEntryPoint GLCompute %main \"main\" %index %buffers
         OpExecutionMode %main LocalSize 2 1 1
         OpName %buffers \"buffers\"
         OpDecorate %index BuiltIn LocalInvocationIndex
         OpDecorate %block Block
         OpMemberDecorate %block 0 Offset 0
         OpDecorate %buffers DescriptorSet 0
         OpDecorate %buffers Binding 0
         OpDecorate %at NonUniform
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %uint = OpTypeInt 32 0
         %u0 = OpConstant %uint 0
         %u2 = OpConstant %uint 2
         %block = OpTypeStruct %uint
         %array = OpTypeArray %block %u2
         %ptr_array = OpTypePointer StorageBuffer %array
         %ptr_uint = OpTypePointer StorageBuffer %uint
         %ptr_index = OpTypePointer Input %uint
         %index = OpVariable %ptr_index Input
         %buffers = OpVariable %ptr_array StorageBuffer
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         %i = OpLoad %uint %index
         %at = OpAccessChain %ptr_uint %buffers %i %u0
         OpStore %at %i
         OpReturn
         OpFunctionEnd"
    )
}

/// The rules that a compute shader breaks, and what is told of each.
fn found(text: &str) -> Vec<(&'static str, String)> {
    let module = Arc::new(anyhit::internals::module::load(&assemble(text)).expect("a module"));
    let program = anyhit::internals::program::lower(&module, &module.entry_points[0]).expect("a program");
    let compute = Compute::new(program).expect("a compute shader").unoptimized().expect("a program");
    let mut resources = Resources::default();
    for element in 0..2 {
        let buffer = Descriptor::Buffer(Buffer::zeroed(4));
        resources.insert(Binding { set: 0, binding: 0 }, element, buffer);
    }
    let (plans, levels) = ([ProgramPlan::new(&compute.program)], Levels::default());
    let mut sanitizer = Sanitizer::new(&plans, &levels);
    compute.run_observed(&resources, [1; 3], &mut |_| (), &mut sanitizer).expect("a run");
    let findings = sanitizer.into_findings();
    findings.iter().map(|finding| (finding.rule.id, finding.error.message().to_owned())).collect()
}

/// VUID-RuntimeSpirv-None-10134 and its siblings: an index that differs needs the capability of the
/// kind of descriptor.
#[test]
fn differing_descriptors_need_the_capability_of_their_kind() {
    let message = "lanes of a subgroup write `buffers[0]` and `buffers[1]`, and the module does not declare \
                   StorageBufferArrayNonUniformIndexing";
    let broken = vec![("nonuniform-capability", message.to_owned())];
    assert_eq!(found(&writes_to_its_own_buffer("")), broken);
    let of_images = "OpCapability StorageImageArrayNonUniformIndexing";
    assert_eq!(found(&writes_to_its_own_buffer(of_images)), broken);
    let declared = "OpCapability StorageBufferArrayNonUniformIndexing";
    assert_eq!(found(&writes_to_its_own_buffer(declared)), []);
}
