//! Why an entry point does not run: each gap once, and a mistake that is none before them.

use anyhit::Module;
use anyhit_engine::program::{lower, obstacles};

use crate::support::assembly::assemble;

/// Why a closest-hit shader does not run that reads an input with a builtin.
fn refused(builtin: &str, body: &str) -> Vec<String> {
    let text = format!(
        "OpCapability Shader
         OpCapability RayTracingKHR
         OpExtension \"SPV_KHR_ray_tracing\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint ClosestHitKHR %main \"main\" %input
         OpDecorate %input BuiltIn {builtin}
         %void = OpTypeVoid
         %uint = OpTypeInt 32 0
         %ptr = OpTypePointer Input %uint
         %input = OpVariable %ptr Input
         %function = OpTypeFunction %void
         %main = OpFunction %void None %function
         %label = OpLabel
         {body}
         OpReturn
         OpFunctionEnd"
    );
    let module = Module::from_spirv(&assemble(&text)).expect("a module");
    let entry = &module.entry_points[0];
    let error = lower(&module, entry).map(|_| ()).expect_err("a gap");
    obstacles(&module, entry, &error)
}

#[test]
fn a_gap_that_ends_the_lowering_is_listed_once() {
    // A builtin of work graphs, which are out of scope.
    const BUILTIN: &str = "RemainingRecursionLevelsAMDX";
    let found = refused(BUILTIN, "%value = OpLoad %uint %input");
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].starts_with("the builtin RemainingRecursionLevelsAMDX is out"), "{found:?}");
    let found = refused(BUILTIN, "OpDemoteToHelperInvocation\n%value = OpLoad %uint %input");
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[1].starts_with("OpDemoteToHelperInvocation"), "{found:?}");
}

#[test]
fn a_mistake_that_is_no_gap_comes_first() {
    // The builtin is one of compute shaders.
    let found = refused("LocalInvocationIndex", "%value = OpLoad %uint %input\nOpDemoteToHelperInvocation");
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[0].contains("LocalInvocationIndex"), "{found:?}");
    assert!(found[1].starts_with("OpDemoteToHelperInvocation"), "{found:?}");
}
