//! Undefined components of cooperative vectors and matrices.

use std::sync::Arc;

use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::module::load;
use anyhit_engine::pipeline::Compute;
use anyhit_engine::program::lower;
use anyhit_sanitize::{Levels, ProgramPlan, Sanitizer};

use crate::support::assembly::assemble;

/// The rules that a compute shader of a subgroup of 32 invocations breaks, with 256 bytes at
/// binding 0.
fn rules(declarations: &str, variables: &str, body: &str) -> Vec<&'static str> {
    let text = format!(
        "OpCapability Shader
         OpCapability VulkanMemoryModel
         OpCapability CooperativeVectorNV
         OpCapability CooperativeMatrixKHR
         OpExtension \"SPV_NV_cooperative_vector\"
         OpExtension \"SPV_KHR_cooperative_matrix\"
         OpMemoryModel Logical Vulkan
         OpEntryPoint GLCompute %main \"main\" %buffer
         OpExecutionMode %main LocalSize 32 1 1
         OpDecorate %floats ArrayStride 4
         OpDecorate %block Block
         OpMemberDecorate %block 0 Offset 0
         OpDecorate %buffer DescriptorSet 0
         OpDecorate %buffer Binding 0
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %bool = OpTypeBool
         %float = OpTypeFloat 32
         %uint = OpTypeInt 32 0
         %false = OpConstantFalse %bool
         %u0 = OpConstant %uint 0
         %u1 = OpConstant %uint 1
         %u2 = OpConstant %uint 2
         %u3 = OpConstant %uint 3
         %u4 = OpConstant %uint 4
         %u8 = OpConstant %uint 8
         %u128 = OpConstant %uint 128
         %one = OpConstant %float 1.0
         %floats = OpTypeRuntimeArray %float
         %block = OpTypeStruct %floats
         %ptr_block = OpTypePointer StorageBuffer %block
         %ptr_floats = OpTypePointer StorageBuffer %floats
         %ptr_float = OpTypePointer StorageBuffer %float
         %ptr_part = OpTypePointer Function %float
         %buffer = OpVariable %ptr_block StorageBuffer
         {declarations}
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         {variables}
         {body}
         OpReturn
         OpFunctionEnd"
    );
    let module = Arc::new(load(&assemble(&text)).unwrap_or_else(|error| panic!("{}", error.render())));
    let program =
        lower(&module, &module.entry_points[0]).unwrap_or_else(|error| panic!("{}", error.render()));
    let compute = Compute::new(program).expect("a compute shader").for_sanitizer().expect("a program");
    let resources = Resources::default().bind(0, 0, Descriptor::Buffer(Buffer::zeroed(256)));
    let (plans, levels) = ([ProgramPlan::new(&compute.program)], Levels::default());
    let mut sanitizer = Sanitizer::new(&plans, &levels).with_resources(&resources);
    compute.run_observed(&resources, [1; 3], &mut |_| (), &mut sanitizer).expect("a run");
    sanitizer.into_findings().iter().map(|finding| finding.rule.id).collect()
}

/// A product of a vector of which the shader writes the second component, and the first, too, if it
/// is told to.
fn product(writes_all: bool, stores: &str) -> Vec<&'static str> {
    let first = if writes_all { "OpStore %first %one" } else { "" };
    let body = format!(
        "%first = OpAccessChain %ptr_part %vector %u0
         {first}
         %second = OpAccessChain %ptr_part %vector %u1
         OpStore %second %one
         %x = OpLoad %vec2 %vector
         %array = OpAccessChain %ptr_floats %buffer %u0
         %y = OpCooperativeVectorMatrixMulNV %vec2 %x %u1 %array %u0 %u1 %u2 %u2 %u0 %false %u8
         {stores}"
    );
    rules(
        "%vec2 = OpTypeVectorIdEXT %float %u2\n%ptr_vec2 = OpTypePointer Function %vec2",
        "%vector = OpVariable %ptr_vec2 Function",
        &body,
    )
}

/// Every component of the product depends on both of the vector.
#[test]
fn products_of_undefined_vectors_are_undefined() {
    let stores = "
        %part = OpCompositeExtract %float %y 1
        %to = OpAccessChain %ptr_float %buffer %u0 %u8
        OpStore %to %part";
    // All invocations store the same bits to the same place.
    assert_eq!(product(false, stores), ["race-same-value", "uninit-function"]);
    assert_eq!(product(true, stores), ["race-same-value"]);
    assert_eq!(product(false, ""), [""; 0]);
}

/// A matrix of 8 x 4: 32 invocations have one component each, and room for four.
fn multiplied(writes: &str) -> Vec<&'static str> {
    let body = format!(
        "%pointer = OpAccessChain %ptr_float %buffer %u0 %u0
         %first = OpAccessChain %ptr_part %variable %u0
         {writes}
         %a = OpLoad %matrix_a %variable
         %b = OpCooperativeMatrixLoadKHR %matrix_b %pointer %u0 %u4 None
         %d = OpCooperativeMatrixMulAddKHR %matrix_c %a %b %none
         OpCooperativeMatrixStoreKHR %pointer %d %u0 %u8 None"
    );
    rules(
        "%matrix_a = OpTypeCooperativeMatrixKHR %float %u3 %u8 %u4 %u0
         %matrix_b = OpTypeCooperativeMatrixKHR %float %u3 %u4 %u4 %u1
         %matrix_c = OpTypeCooperativeMatrixKHR %float %u3 %u8 %u4 %u2
         %none = OpConstantNull %matrix_c
         %ptr_matrix = OpTypePointer Function %matrix_a",
        "%variable = OpVariable %ptr_matrix Function",
        &body,
    )
}

#[test]
fn products_of_undefined_matrices_are_reported() {
    assert_eq!(multiplied(""), ["uninit-function"]);
    // The other registers of an invocation hold no component.
    assert_eq!(multiplied("OpStore %first %one"), [""; 0]);
}
