//! What the sanitizer tells of modules that no compiler writes.

use std::sync::Arc;

use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::pipeline::{Compute, Launch, Pipeline};
use anyhit_sanitize::{Findings, Levels, ProgramPlan, Sanitizer};

use crate::support::assembly::assemble;
use crate::support::files::root;
use crate::support::program::{anyhit, at, scratch};

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
    findings(text).iter().map(|finding| (finding.rule.id, finding.error.message().to_owned())).collect()
}

/// What the sanitizer finds in a compute shader with two storage buffers.
fn findings(text: &str) -> Findings {
    let module = Arc::new(anyhit_engine::module::load(&assemble(text)).expect("a module"));
    let program = anyhit_engine::program::lower(&module, &module.entry_points[0]).expect("a program");
    let compute = Compute::new(program).expect("a compute shader").for_sanitizer().expect("a program");
    let mut resources = Resources::default();
    for element in 0..2 {
        let buffer = Descriptor::Buffer(Buffer::zeroed(8));
        resources.insert(Binding { set: 0, binding: 0 }, element, buffer);
    }
    let (plans, levels) = ([ProgramPlan::new(&compute.program)], Levels::default());
    let mut sanitizer = Sanitizer::new(&plans, &levels);
    compute.run_observed(&resources, [1; 3], &mut |_| (), &mut sanitizer).expect("a run");
    sanitizer.into_findings()
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

/// A shader whose two invocations store a part of a constant, or of another where their index is 1.
fn stores_a_constant(other: &str) -> String {
    format!(
        "OpCapability Shader
         OpCapability ShaderNonUniform
         OpMemoryModel Logical GLSL450
         OpEntryPoint GLCompute %main \"main\" %index %buffers
         OpExecutionMode %main LocalSize 2 1 1
         OpDecorate %index BuiltIn LocalInvocationIndex
         OpDecorate %array ArrayStride 4
         OpDecorate %block Block
         OpMemberDecorate %block 0 Offset 0
         OpDecorate %buffers DescriptorSet 0
         OpDecorate %buffers Binding 0
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %bool = OpTypeBool
         %uint = OpTypeInt 32 0
         %pair = OpTypeVector %uint 2
         %u0 = OpConstant %uint 0
         %u2 = OpConstant %uint 2
         %undef = OpUndef %uint
         %undefs = OpUndef %pair
         %poison = OpPoisonKHR %uint
         %half = OpConstantComposite %pair %u2 %undef
         %array = OpTypeRuntimeArray %uint
         %block = OpTypeStruct %array
         %ptr_block = OpTypePointer StorageBuffer %block
         %ptr_uint = OpTypePointer StorageBuffer %uint
         %ptr_index = OpTypePointer Input %uint
         %index = OpVariable %ptr_index Input
         %buffers = OpVariable %ptr_block StorageBuffer
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         %i = OpLoad %uint %index
         %is_first = OpIEqual %bool %i %u0
         %copied = OpCopyObject %uint %undef
         %local = OpPoisonKHR %uint
         %frozen = OpFreezeKHR %uint %undef
         %frozen_local = OpFreezeKHR %uint %local
         %frozen_half = OpFreezeKHR %pair %half
         %of_frozen = OpCompositeExtract %uint %frozen_half 1
         %of_half = OpCompositeExtract %uint %half 1
         %of_pair = OpCompositeExtract %uint %undefs 0
         %defined = OpCompositeExtract %uint %half 0
         %value = OpSelect %uint %is_first %u2 %{other}
         %at = OpAccessChain %ptr_uint %buffers %u0 %i
         OpStore %at %value
         OpReturn
         OpFunctionEnd"
    )
}

/// `OpUndef` at module scope is where optimizers put what is left of variables that were not
/// written (SPIR-V 2.4: it may stand among the constants).
#[test]
fn undefined_constants_are_told_where_something_depends_on_them() {
    let message = "a value that the shader leaves undefined reaches a buffer".to_owned();
    for other in ["undef", "copied", "of_half", "of_pair", "poison", "local"] {
        assert_eq!(found(&stores_a_constant(other)), [("undef-use", message.clone())], "{other}");
    }
    // Copied, but never stored; frozen (SPV_KHR_poison_freeze: any value, but a stable one).
    for other in ["u0", "defined", "frozen", "frozen_local", "of_frozen"] {
        assert_eq!(found(&stores_a_constant(other)), [], "{other}");
    }
}

/// A ray generation shader that passes two numbers to a callable one, each of which lays them out
/// by these offsets of the second number.
fn passes_laid_out_data(given: Option<u32>, taken: Option<u32>) -> String {
    let offsets = |name: &str, second: Option<u32>| match second {
        Some(second) => {
            format!("OpMemberDecorate %{name} 0 Offset 0\nOpMemberDecorate %{name} 1 Offset {second}")
        }
        None => String::new(),
    };
    format!(
        "OpCapability RayTracingKHR
         OpExtension \"SPV_KHR_ray_tracing\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint RayGenerationKHR %main \"main\" %passed
         OpEntryPoint CallableKHR %called \"called\" %incoming
         {}
         {}
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %uint = OpTypeInt 32 0
         %u0 = OpConstant %uint 0
         %u1 = OpConstant %uint 1
         %given = OpTypeStruct %uint %uint
         %taken = OpTypeStruct %uint %uint
         %ptr_given = OpTypePointer CallableDataKHR %given
         %ptr_given_uint = OpTypePointer CallableDataKHR %uint
         %ptr_taken = OpTypePointer IncomingCallableDataKHR %taken
         %ptr_taken_uint = OpTypePointer IncomingCallableDataKHR %uint
         %passed = OpVariable %ptr_given CallableDataKHR
         %incoming = OpVariable %ptr_taken IncomingCallableDataKHR
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         %first = OpAccessChain %ptr_given_uint %passed %u0
         OpStore %first %u1
         OpExecuteCallableKHR %u0 %passed
         OpReturn
         OpFunctionEnd
         %called = OpFunction %void None %main_type
         %called_entry = OpLabel
         %in_first = OpAccessChain %ptr_taken_uint %incoming %u0
         %in_second = OpAccessChain %ptr_taken_uint %incoming %u1
         %value = OpLoad %uint %in_first
         OpStore %in_second %value
         OpReturn
         OpFunctionEnd",
        offsets("given", given),
        offsets("taken", taken),
    )
}

/// The rules that a launch of a module's ray generation shader breaks, with its callable shaders.
fn found_by_launch(text: &str) -> Vec<(&'static str, String)> {
    let module = Arc::new(anyhit_engine::module::load(&assemble(text)).expect("a module"));
    let mut builder = Pipeline::builder();
    for entry in &module.entry_points {
        let program = anyhit_engine::program::lower(&module, entry).expect("a program");
        builder = match entry.stage {
            Stage::RayGeneration => builder.ray_generation(program),
            _ => builder.callable(program),
        }
        .expect("a shader of its stage");
    }
    let pipeline = builder.build().and_then(|pipeline| pipeline.for_sanitizer()).expect("a pipeline");
    let plans: Vec<ProgramPlan> = pipeline.programs.iter().map(ProgramPlan::new).collect();
    let (levels, resources) = (Levels::default(), Resources::default());
    let mut sanitizer = Sanitizer::new(&plans, &levels).of_pipeline(&pipeline);
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    launch.run_observed([1; 3], &mut |_| (), &mut sanitizer).expect("a launch");
    let findings = sanitizer.into_findings();
    findings.iter().map(|finding| (finding.rule.id, finding.error.message().to_owned())).collect()
}

/// A ray generation shader that passes a number to a callable one, which has no variable for it;
/// the module carries a source.
fn passes_data_to_nothing(source: &str) -> String {
    format!(
        "OpCapability RayTracingKHR
         OpExtension \"SPV_KHR_ray_tracing\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint RayGenerationKHR %main \"main\" %passed
         OpEntryPoint CallableKHR %called \"called\"
         %file = OpString \"called.rcall\"
         OpSource 2 460 %file \"{source}\"
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %uint = OpTypeInt 32 0
         %u0 = OpConstant %uint 0
         %ptr_given = OpTypePointer CallableDataKHR %uint
         %passed = OpVariable %ptr_given CallableDataKHR
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         OpStore %passed %u0
         OpExecuteCallableKHR %u0 %passed
         OpReturn
         OpFunctionEnd
         %called = OpFunction %void None %main_type
         %called_entry = OpLabel
         OpReturn
         OpFunctionEnd"
    )
}

/// Vulkan, "Ray Tracing Pipeline Interface": a called shader declares the data, even if it does not
/// use it; an optimizer drops the variable then.
#[test]
fn data_that_the_source_declares_is_declared() {
    let rules = |source: &str| -> Vec<_> {
        let found = found_by_launch(&passes_data_to_nothing(source));
        found.into_iter().map(|(rule, _)| rule).collect()
    };
    assert_eq!(rules("layout(location = 0) callableDataInEXT uint data"), [""; 0]);
    assert_eq!(rules("void main() {}"), ["callable-undeclared"]);
    assert_eq!(rules("void main() {} // no callableDataInEXT"), ["callable-undeclared"]);
}

/// VUID-RuntimeSpirv-OpTraceRayKHR-11855 compares layouts where there are any.
#[test]
fn data_that_is_laid_out_is_laid_out_alike() {
    // Nobody reads the data.
    let found_by_launch = |text: &str| -> Vec<_> {
        found_by_launch(text).into_iter().filter(|(rule, _)| *rule != "payload-unread").collect()
    };
    let found = found_by_launch(&passes_laid_out_data(Some(4), Some(16)));
    assert_eq!(found.iter().map(|found| found.0).collect::<Vec<_>>(), ["payload-decoration"]);
    assert!(found[0].1.contains("CallableKHR `called` lays out"), "{}", found[0].1);
    for (given, taken) in [(Some(4), Some(4)), (Some(16), Some(16)), (None, None), (None, Some(16))] {
        assert_eq!(found_by_launch(&passes_laid_out_data(given, taken)), [], "{given:?} {taken:?}");
    }
}

/// naga wraps instructions of ray queries in functions of its own, which have no lines.
#[test]
fn a_function_without_lines_is_told_by_the_line_of_its_call() {
    let text = "OpCapability Shader
         OpMemoryModel Logical GLSL450
         OpEntryPoint GLCompute %main \"main\" %buffers
         OpExecutionMode %main LocalSize 1 1 1
         %file = OpString \"made.wgsl\"
         OpDecorate %block Block
         OpMemberDecorate %block 0 Offset 0
         OpDecorate %buffers DescriptorSet 0
         OpDecorate %buffers Binding 0
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %uint = OpTypeInt 32 0
         %helper_type = OpTypeFunction %uint %uint
         %u0 = OpConstant %uint 0
         %u7 = OpConstant %uint 7
         %block = OpTypeStruct %uint
         %ptr_block = OpTypePointer StorageBuffer %block
         %ptr_uint = OpTypePointer StorageBuffer %uint
         %buffers = OpVariable %ptr_block StorageBuffer
         %helper = OpFunction %uint None %helper_type
         %divisor = OpFunctionParameter %uint
         %helper_entry = OpLabel
         %quotient = OpUDiv %uint %u7 %divisor
         OpReturnValue %quotient
         OpFunctionEnd
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         %at = OpAccessChain %ptr_uint %buffers %u0
         %zero = OpLoad %uint %at
         OpLine %file 12 5
         %result = OpFunctionCall %uint %helper %zero
         OpStore %at %result
         OpReturn
         OpFunctionEnd";
    let findings = findings(text);
    let [finding] = &findings.iter().collect::<Vec<_>>()[..] else { panic!("{} findings", findings.len()) };
    assert_eq!(finding.rule.id, "int-div-zero");
    let frame = &finding.stack[0];
    assert_eq!((frame.file.as_deref(), frame.line), (Some("made.wgsl"), Some(12)));
    assert!(finding.error.render().contains("made.wgsl:12:5"), "{}", finding.error.render());
}

/// A fixture without its execution mode `OpacityMicromapIdKHR`.
fn without_micromap_mode(fixture: &str) -> Vec<u8> {
    const EXECUTION_MODE_ID: u32 = 331;
    const OPACITY_MICROMAP_ID: u32 = 6031;
    let bytes = std::fs::read(root().join("spirv-fixtures").join(fixture)).expect("a fixture");
    let words: Vec<u32> =
        bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().expect("a word"))).collect();
    let mut kept = words[..5].to_vec();
    let mut rest = &words[5..];
    while let [first, ..] = rest {
        let (instruction, behind) = rest.split_at((first >> 16) as usize);
        if (first & 0xffff, instruction.get(2)) != (EXECUTION_MODE_ID, Some(&OPACITY_MICROMAP_ID)) {
            kept.extend(instruction);
        }
        rest = behind;
    }
    assert!(kept.len() < words.len(), "{fixture} has no such mode");
    kept.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// SPV_KHR_opacity_micromap: "If ray query traversal uses acceleration structures with opacity
/// micromaps, this execution mode must be specified with a value of true; otherwise, undefined
/// behavior will result." Dispatches and launches alike.
#[test]
fn ray_queries_over_micromaps_need_their_mode() {
    for (case, fixture) in [
        ("sanitize/rq-micromap", "sanitize/rq-micromap/mended.comp.spv"),
        ("pass/opacity-micromap/states", "pass/opacity-micromap/states/main.rgen.spv"),
    ] {
        let folder = scratch(&format!("micromap-mode-{}", fixture.replace('/', "-")));
        std::fs::write(folder.join("stripped.spv"), without_micromap_mode(fixture))
            .expect("a writable folder");
        let shaders = root().to_str().expect("UTF-8").replace('\\', "/");
        let text =
            std::fs::read_to_string(root().join("shaders").join(case).join("scene.toml")).expect("a scene");
        let text = text.replace("broken.comp", "mended.comp");
        let up = "../".repeat(case.matches('/').count() + 2);
        assert!(text.contains(&format!("{up}spirv-fixtures/{fixture}")), "{text}");
        let whole = text.replace(&up, &format!("{shaders}/"));
        let stripped = text.replace(&format!("{up}spirv-fixtures/{fixture}"), "stripped.spv");
        let stripped = stripped.replace(&up, &format!("{shaders}/"));
        for (name, text, is_denied) in [("whole.toml", whole, false), ("stripped.toml", stripped, true)] {
            std::fs::write(folder.join(name), text).expect("a writable folder");
            let ran = anyhit(&["run", &at(&folder, name), "--sanitize"]);
            assert_eq!(ran.code, Some(if is_denied { 6 } else { 0 }), "{case} {name}: {}", ran.err);
            let printed = ran.out + &ran.err;
            assert_eq!(printed.contains("error[rq-micromap]"), is_denied, "{case} {name}: {printed}");
        }
    }
}
