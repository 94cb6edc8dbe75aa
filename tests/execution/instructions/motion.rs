//! Traces at a moment (`SPV_NV_ray_tracing_motion_blur`): the shaders that they call see the time.
//! What moves is in `shaders/pass/motion-blur`.

use std::sync::Arc;

use anyhit_base::error::{ErrorKind, Result};
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{Launch, Pipeline, RunOptions};

use crate::support::assembly::assemble;

/// A ray generation shader that traces into nothing at a time, with the payload by variable or (as
/// `SPV_NV_ray_tracing` does) by location; and a miss shader that hands the time back.
fn module(time: f32, by_location: bool) -> Vec<u8> {
    let time = time.to_bits();
    let trace = match by_location {
        false => "OpTraceRayMotionNV %as %0 %mask %0 %0 %0 %origin %near %up %far %time %payload",
        true => "OpTraceMotionNV %as %0 %mask %0 %0 %0 %origin %near %up %far %time %2",
    };
    assemble(&format!(
        "OpCapability RayTracingKHR
         OpCapability RayTracingNV
         OpCapability RayTracingMotionBlurNV
         OpExtension \"SPV_KHR_ray_tracing\"
         OpExtension \"SPV_NV_ray_tracing_motion_blur\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint RayGenerationKHR %main \"main\" %structure %out %payload
         OpEntryPoint MissKHR %sky \"sky\" %incoming %current_time
         OpDecorate %structure DescriptorSet 0
         OpDecorate %structure Binding 0
         OpDecorate %out DescriptorSet 0
         OpDecorate %out Binding 1
         OpDecorate %Out Block
         OpMemberDecorate %Out 0 Offset 0
         OpDecorate %payload Location 2
         OpDecorate %current_time BuiltIn CurrentRayTimeNV
         %void = OpTypeVoid
         %function = OpTypeFunction %void
         %uint = OpTypeInt 32 0
         %float = OpTypeFloat 32
         %float3 = OpTypeVector %float 3
         %0 = OpConstant %uint 0
         %2 = OpConstant %uint 2
         %mask = OpConstant %uint 255
         %near = OpConstant %float 0
         %far = OpConstant %float 1065353216
         %time = OpConstant %float {time}
         %origin = OpConstantComposite %float3 %near %near %near
         %up = OpConstantComposite %float3 %near %near %far
         %Structure = OpTypeAccelerationStructureKHR
         %structure_pointer = OpTypePointer UniformConstant %Structure
         %structure = OpVariable %structure_pointer UniformConstant
         %Out = OpTypeStruct %float
         %out_pointer = OpTypePointer StorageBuffer %Out
         %out = OpVariable %out_pointer StorageBuffer
         %float_pointer = OpTypePointer StorageBuffer %float
         %payload_pointer = OpTypePointer RayPayloadKHR %float
         %payload = OpVariable %payload_pointer RayPayloadKHR
         %incoming_pointer = OpTypePointer IncomingRayPayloadKHR %float
         %incoming = OpVariable %incoming_pointer IncomingRayPayloadKHR
         %time_pointer = OpTypePointer Input %float
         %current_time = OpVariable %time_pointer Input
         %main = OpFunction %void None %function
         %begin = OpLabel
         OpStore %payload %far
         %as = OpLoad %Structure %structure
         {trace}
         %result = OpLoad %float %payload
         %to = OpAccessChain %float_pointer %out %0
         OpStore %to %result
         OpReturn
         OpFunctionEnd
         %sky = OpFunction %void None %function
         %sky_begin = OpLabel
         %now = OpLoad %float %current_time
         OpStore %incoming %now
         OpReturn
         OpFunctionEnd"
    ))
}

fn seen(time: f32, by_location: bool) -> Result<f32> {
    let module = Arc::new(anyhit_engine::module::load(&module(time, by_location))?);
    let shader = |name| anyhit::Program::of(&module, name);
    let pipeline = Pipeline::builder().ray_generation(shader("main")?)?.miss(shader("sky")?)?.build()?;
    let out = Buffer::zeroed(4);
    let resources = Resources::default()
        .bind(0, 0, Descriptor::AccelerationStructure(Tlas::new(Vec::new())?))
        .bind(0, 1, Descriptor::Buffer(out.clone()));
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    launch.run([1; 3], RunOptions::default())?;
    Ok(f32::from_bits(out.load(0, 32).expect("a word")))
}

#[test]
fn the_shaders_that_a_trace_calls_see_its_time() {
    assert_eq!(seen(0.25, false).unwrap(), 0.25);
    assert_eq!(seen(1.0, true).unwrap(), 1.0);
}

#[test]
fn a_time_lies_between_0_and_1() {
    // VUID-RuntimeSpirv-OpTraceRayMotionNV-06366
    for wrong in [1.5, -0.5, f32::NAN] {
        assert_eq!(seen(wrong, false).unwrap_err().kind(), ErrorKind::Trap);
    }
}
