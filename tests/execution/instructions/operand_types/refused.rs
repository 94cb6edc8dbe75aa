//! What the table does not allow is refused: each operand in turn gets every other type.

use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use anyhit_base::error::ErrorKind;

use crate::execution::instructions::operand_types::rules::Rule;
use crate::execution::instructions::operand_types::types::{KINDS, Ty};
use crate::execution::instructions::operand_types::{Case, special, table};
use crate::support::assembly::assemble;
use crate::support::skipped::{self, test_name};

/// The instruction by itself, with operands that are all zero.
fn instruction(case: &Case, at: usize) -> String {
    let operands: String = case.types[1..].iter().map(|ty| format!(" %zero_{}", ty.name())).collect();
    case.text(&format!("r{at}"), &operands)
}

/// A module with an entry point for each text of a body.
pub fn module(bodies: &[String]) -> String {
    let mut text = String::from(
        "OpCapability Shader
         OpCapability RayTracingKHR
         OpCapability Int64
         OpCapability Int16
         OpCapability Int8
         OpCapability Float64
         OpCapability Float16
         OpCapability GroupNonUniformArithmetic
         OpCapability GroupNonUniformShuffle
         OpCapability GroupNonUniformBallot
         OpCapability DotProduct
         OpCapability DotProductInputAll
         OpCapability DotProductInput4x8Bit
         OpCapability DotProductInput4x8BitPacked
         OpCapability GroupNonUniformVote
         OpCapability ExpectAssumeKHR
         OpCapability IntegerFunctions2INTEL
         OpExtension \"SPV_KHR_ray_tracing\"
         OpExtension \"SPV_KHR_expect_assume\"
         OpExtension \"SPV_INTEL_shader_integer_functions2\"
         %glsl = OpExtInstImport \"GLSL.std.450\"
         OpMemoryModel Logical GLSL450\n",
    );
    for at in 0..bodies.len() {
        let _ = writeln!(text, "OpEntryPoint RayGenerationKHR %main{at} \"main{at}\"");
    }
    text += "%void = OpTypeVoid\n%main_type = OpTypeFunction %void\n%bool = OpTypeBool\n";
    for kind in KINDS {
        let _ = match kind.bits() {
            0 => Ok(()),
            bits if kind.is_float() => writeln!(text, "%{} = OpTypeFloat {bits}", kind.name()),
            bits => {
                writeln!(text, "%{} = OpTypeInt {bits} {}", kind.name(), u32::from(kind.is_signed()))
            }
        };
    }
    for ty in Ty::all().filter(|ty| ty.count > 1) {
        let _ = writeln!(text, "%{} = OpTypeVector %{} {}", ty.name(), ty.kind.name(), ty.count);
    }
    for ty in Ty::all() {
        let name = ty.name();
        let _ = writeln!(
            text,
            "%pair_{name} = OpTypeStruct %{name} %{name}\n%zero_{name} = OpConstantNull %{name}"
        );
    }
    text += "%m2 = OpTypeMatrix %float3 2
         %zero_m2 = OpConstantNull %m2
         %q2 = OpTypeMatrix %float2 2
         %zero_q2 = OpConstantNull %q2
         %h3 = OpTypeMatrix %half2 3
         %zero_h3 = OpConstantNull %h3
         %one = OpConstant %uint 1
         %u3 = OpConstant %uint 3
         %zero = OpConstant %uint 0\n";
    for kind in KINDS {
        let _ = writeln!(text, "%function_{0} = OpTypePointer Function %{0}", kind.name());
    }
    for (at, body) in bodies.iter().enumerate() {
        let _ = writeln!(
            text,
            "%main{at} = OpFunction %void None %main_type\n%entry{at} = OpLabel\n{body}\nOpReturn\nOpFunctionEnd"
        );
    }
    text
}

/// Those of the entry points of bodies that are not refused as invalid, with what happened.
pub fn not_refused(bodies: &[String]) -> Vec<(usize, String)> {
    let module =
        Arc::new(anyhit_engine::module::load(&assemble(&module(bodies))).expect("a module that loads"));
    let mut found = Vec::new();
    for (at, entry) in module.entry_points.iter().enumerate() {
        let told = match catch_unwind(AssertUnwindSafe(|| anyhit_engine::program::lower(&module, entry))) {
            Ok(Ok(_)) => "runs".to_owned(),
            Ok(Err(error)) if error.kind() == ErrorKind::InvalidModule => {
                assert!(!error.message().contains("bug in anyhit"), "{}", error.render());
                continue;
            }
            Ok(Err(error)) => error.message().to_owned(),
            Err(_) => "panics".to_owned(),
        };
        found.push((at, told));
    }
    found
}

/// Combinations that a rule does not allow, each one type away from one that it does.
fn illegal(rule: &Rule, glsl: bool) -> Vec<Case> {
    let legal = rule.legal();
    // One combination of scalars and one of vectors.
    let scalars = legal.iter().find(|types| types.iter().all(|ty| ty.count == 1));
    let vectors = legal.iter().rfind(|types| types.iter().any(|ty| ty.count == 2));
    let mut found = Vec::new();
    for types in scalars.into_iter().chain(vectors) {
        for at in 0..types.len() {
            for other in Ty::all().filter(|ty| ty.count != 4) {
                let mut types = types.clone();
                types[at] = other;
                if !rule.allows(&types) {
                    found.push(Case::new(rule, glsl, types));
                }
            }
        }
    }
    found
}

/// Every combination one type away from the table.
fn all_illegal() -> Vec<Case> {
    let mut cases: Vec<Case> = table().iter().flat_map(|(rule, glsl)| illegal(rule, *glsl)).collect();
    cases.extend(special::illegal());
    cases
}

/// With the path of `spirv-val` in `ANYHIT_SPIRV_VAL` it judges the table: it accepts each
/// combination that is allowed, and rejects a part of those that are not.
#[test]
fn spirv_val_agrees_with_the_table() {
    let Some(validator) = skipped::variable(test_name!(), "ANYHIT_SPIRV_VAL") else { return };
    // Whether it accepts the instructions of these cases.
    let accepts = |cases: &[Case]| {
        let bodies: Vec<String> = cases.iter().enumerate().map(|(at, case)| instruction(case, at)).collect();
        let mut file = tempfile::NamedTempFile::new().expect("a file");
        std::io::Write::write_all(&mut file, &assemble(&module(&bodies))).expect("a written file");
        let run =
            std::process::Command::new(&validator).args(["--target-env", "spv1.6"]).arg(file.path()).output();
        let output = run.expect("a validator that starts");
        (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    // Younger than most validators, or called Kernel's by the grammar.
    let known =
        |case: &Case| !["FmaKHR", "FreezeKHR", "LessOrGreater", "Ordered", "Unordered"].contains(&case.name);
    // Whose operands older validators hold against nothing: the rules stand in the specifications.
    let judges = |case: &Case| {
        let unchecked = ["INTEL", "GroupNonUniform", "SDot", "UDot"];
        !unchecked.iter().any(|part| case.name.contains(part))
    };
    let mut wrong = Vec::new();
    let mut judged = [0; 2];
    for (rule, glsl) in table() {
        let case = |types| Case::new(&rule, glsl, types);
        let cases: Vec<Case> = rule.legal().into_iter().map(case).filter(known).collect();
        if let (false, told) = accepts(&cases)
            && !cases.is_empty()
        {
            wrong.push(format!("{} is rejected: {told}", rule.name));
        }
        judged[0] += cases.len();
    }
    for cases in special::cases().chunks(100) {
        if let (false, told) = accepts(cases) {
            wrong.push(format!("{} is rejected: {told}", cases[0].name));
        }
        judged[0] += cases.len();
    }
    for case in all_illegal().into_iter().filter(|case| known(case) && judges(case)).step_by(7) {
        if accepts(std::slice::from_ref(&case)).0 {
            let types: Vec<String> = case.types.iter().map(|ty| ty.name()).collect();
            wrong.push(format!("{} {types:?} is accepted", case.name));
        }
        judged[1] += 1;
    }
    assert!(wrong.is_empty(), "of {judged:?} {} wrong:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn what_the_specification_does_not_allow_is_refused() {
    let cases = all_illegal();
    assert!(cases.len() > 10_000, "{}", cases.len());
    let mut wrong = Vec::new();
    for cases in cases.chunks(500) {
        let bodies: Vec<String> = cases.iter().enumerate().map(|(at, case)| instruction(case, at)).collect();
        for (at, told) in not_refused(&bodies) {
            let types: Vec<String> = cases[at].types.iter().map(|ty| ty.name()).collect();
            wrong.push(format!("{} {types:?} {told}", cases[at].name));
        }
    }
    assert!(wrong.is_empty(), "{} not refused:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn a_missing_operand_is_refused() {
    let mut bodies = Vec::new();
    for (rule, glsl) in table().into_iter().filter(|(_, glsl)| *glsl) {
        let mut types = rule.legal().swap_remove(0);
        types.pop();
        let case = Case::new(&rule, glsl, types);
        bodies.push(instruction(&case, bodies.len()));
    }
    assert!(bodies.len() > 60, "{}", bodies.len());
    assert_eq!(not_refused(&bodies), []);
}

/// Declarations, body and functions that give a value another type on its way.
const CHANGED: &[(&str, &str, &str)] = &[
    (
        "",
        "%is = OpIEqual %bool %id %u0
         OpSelectionMerge %m None
         OpBranchConditional %is %t %m
         %t = OpLabel
         OpBranch %m
         %m = OpLabel
         %p = OpPhi %float %u1 %t %u2 %entry
         %w = OpBitcast %uint %p
         out 0 %w",
        "",
    ),
    (
        "%bad = OpConstantComposite %float2 %u1 %u2",
        "%x = OpCompositeExtract %float %bad 0\n%w = OpBitcast %uint %x\nout 0 %w",
        "",
    ),
    ("%bad = OpConstantComposite %uint2 %u1 %u2 %u3", "%x = OpCompositeExtract %uint %bad 0\nout 0 %x", ""),
    (
        "%pair = OpTypeStruct %uint %float\n%bad = OpConstantComposite %pair %u1 %u2",
        "%x = OpCompositeExtract %uint %bad 0\nout 0 %x",
        "",
    ),
    (
        "%bad = OpConstantCompositeReplicateEXT %float2 %u1",
        "%x = OpCompositeExtract %float %bad 0\n%w = OpBitcast %uint %x\nout 0 %w",
        "",
    ),
    ("", "%bad = OpCompositeConstructReplicateEXT %float2 %id\n%v = OpBitcast %uint2 %bad", ""),
    ("%bad = OpSpecConstantOp %float IAdd %u1 %u2", "%w = OpBitcast %uint %bad\nout 0 %w", ""),
    (
        "%to_float = OpTypePointer Private %float
         %a = OpVariable %to_float Private
         %b = OpVariable %ptr_Private_uint Private",
        "OpCopyMemory %b %a\n%w = OpLoad %uint %b\nout 0 %w",
        "",
    ),
    (
        "%one = OpTypeStruct %uint\n%other = OpTypeStruct %float",
        "%a = OpCompositeConstruct %one %id\n%b = OpCopyLogical %other %a",
        "",
    ),
    (
        "%f1 = OpConstant %float 1.0\n%v = OpVariable %ptr_Private_uint Private %f1",
        "%w = OpLoad %uint %v\nout 0 %w",
        "",
    ),
    (
        "%gives = OpTypeFunction %float",
        "%f = OpFunctionCall %float %given",
        "%given = OpFunction %float None %gives\n%first = OpLabel\nOpReturnValue %u1\nOpFunctionEnd",
    ),
    (
        "%takes = OpTypeFunction %void %float",
        "%f = OpFunctionCall %void %taken %id",
        "%taken = OpFunction %void None %takes
         %parameter = OpFunctionParameter %float
         %first = OpLabel
         OpReturn
         OpFunctionEnd",
    ),
];

#[test]
fn a_value_keeps_its_type() {
    let mut wrong = Vec::new();
    for &(declarations, body, functions) in CHANGED {
        let shader = crate::execution::instructions::run::Shader {
            declarations,
            body,
            functions,
            ..Default::default()
        };
        match shader.run_with(&mut Default::default) {
            Err(error) if error.kind() == ErrorKind::InvalidModule => {}
            Err(error) => wrong.push(format!("{declarations}\n{body}: {}", error.render())),
            Ok(_) => wrong.push(format!("{declarations}\n{body} runs")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
