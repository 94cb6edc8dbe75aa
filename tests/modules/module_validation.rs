//! `inspect`, `run`, `test` and `smoke` on modules that lack a declaration: a warning, and an error
//! with `--strict`.

use std::fs;
use std::path::{Path, PathBuf};

use anyhit_engine::module;

use crate::support::assembly::assemble;
use crate::support::mutate::{Original, Random};
use crate::support::program::{Ran, anyhit, scratch};

/// A compute shader that doubles a double; `{}` is where it may declare `Float64`.
const DOUBLE: &str = "
    OpCapability Shader
    {}
    OpMemoryModel Logical GLSL450
    OpEntryPoint GLCompute %main \"main\" %out
    OpExecutionMode %main LocalSize 1 1 1
    OpDecorate %Out Block
    OpMemberDecorate %Out 0 Offset 0
    OpDecorate %out DescriptorSet 0
    OpDecorate %out Binding 0
    %void = OpTypeVoid
    %fn = OpTypeFunction %void
    %double = OpTypeFloat 64
    %uint = OpTypeInt 32 0
    %zero = OpConstant %uint 0
    %Out = OpTypeStruct %double
    %block = OpTypePointer StorageBuffer %Out
    %pointer = OpTypePointer StorageBuffer %double
    %out = OpVariable %block StorageBuffer
    %main = OpFunction %void None %fn
    %entry = OpLabel
    %p = OpAccessChain %pointer %out %zero
    %x = OpLoad %double %p
    %y = OpFAdd %double %x %x
    OpStore %p %y
    OpReturn
    OpFunctionEnd";

const SCENE: &str = r#"
version = 1

[shaders]
main = "lacking.spv"

[[dispatch]]
shader = "main"

[resources.out]
type = "storage_buffer"
binding = 0
size = 8

[[expect.buffer]]
name = "out"
f64 = [0]
because = "0 + 0"
"#;

const MISSING: &str =
    "OpTypeFloat of 64 bits requires the capability Float64, which the module does not declare";

fn module(folder: &Path, name: &str, declaration: &str) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, assemble(&DOUBLE.replace("{}", declaration))).expect("a writable folder");
    path
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[track_caller]
fn warns(ran: &Ran, code: i32) {
    assert_eq!(ran.code, Some(code), "{ran:?}");
    assert_eq!(ran.err.matches("warning: ").count(), 1, "{ran:?}");
    assert!(ran.err.contains(MISSING) && ran.err.contains("declare `OpCapability Float64`"), "{ran:?}");
}

#[track_caller]
fn rejects(ran: &Ran) {
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(ran.err.contains("error[capability]") && ran.err.contains(MISSING), "{ran:?}");
}

#[test]
fn inspect_reports_what_a_module_does_not_declare() {
    let folder = scratch("module-validation-inspect");
    let lacking = module(&folder, "lacking.spv", "");
    let ran = anyhit(&["inspect", text(&lacking)]);
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
    assert!(ran.out.contains(&format!("warning[capability]: {MISSING}")), "{}", ran.out);
    assert!(ran.out.contains("GLCompute `main`: supported"), "{}", ran.out);
    rejects(&anyhit(&["inspect", "--strict", text(&lacking)]));

    let ran = anyhit(&["inspect", "--json", text(&lacking)]);
    let report: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
    let finding = &report["validation"][0];
    assert_eq!((&finding["class"], &finding["message"]), (&"capability".into(), &MISSING.into()));
    assert!(finding["word"].as_u64().is_some_and(|word| word > 40), "{finding}");

    let whole = module(&folder, "whole.spv", "OpCapability Float64");
    let ran = anyhit(&["inspect", "--strict", text(&whole)]);
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
    assert!(!ran.out.contains("warning"), "{}", ran.out);
}

/// SPIR-V, 2.16.1: a logical pointer is no result of `OpBitcast`. Lowering finds it.
#[test]
fn inspect_rejects_what_lowering_finds_invalid() {
    let folder = scratch("module-validation-lowering");
    let bitcast = DOUBLE
        .replace("{}", "OpCapability Float64")
        .replace("%x = OpLoad %double %p", "%same = OpBitcast %pointer %p\n%x = OpLoad %double %same");
    let path = folder.join("bitcast.spv");
    fs::write(&path, assemble(&bitcast)).expect("a writable folder");
    let ran = anyhit(&["inspect", text(&path)]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(ran.out.contains("GLCompute `main`: INVALID"), "{}", ran.out);
    assert!(ran.err.contains("SPIR-V, 2.16.1") && !ran.err.contains("limitation of anyhit"), "{}", ran.err);
}

/// A load whose value nothing reads lies outside of its buffer, which has one double.
#[test]
fn a_test_under_the_sanitizer_runs_what_is_eliminated() {
    let folder = scratch("module-validation-dead-load");
    let dead = DOUBLE
        .replace("{}", "OpCapability Float64")
        .replace("%Out = OpTypeStruct %double", "%Out = OpTypeStruct %many")
        .replace(
            "%zero = OpConstant %uint 0",
            "%zero = OpConstant %uint 0\n%far = OpConstant %uint 1000\n%many = OpTypeRuntimeArray %double",
        )
        .replace(
            "OpMemberDecorate %Out 0 Offset 0",
            "OpMemberDecorate %Out 0 Offset 0\nOpDecorate %many ArrayStride 8",
        )
        .replace(
            "%p = OpAccessChain %pointer %out %zero",
            "%p = OpAccessChain %pointer %out %zero %zero\n%q = OpAccessChain %pointer %out %zero %far\n\
             %unused = OpLoad %double %q",
        );
    fs::write(folder.join("lacking.spv"), assemble(&dead)).expect("a writable folder");
    let scene = folder.join("scene.toml");
    fs::write(&scene, SCENE).expect("a writable folder");
    assert_eq!(anyhit(&["test", text(&scene)]).code, Some(0));
    let ran = anyhit(&["test", text(&scene), "--sanitize"]);
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert!(ran.out.contains("a shader trapped under the sanitizer"), "{}", ran.out);
}

#[test]
fn commands_that_run_a_module_warn_once() {
    let folder = scratch("module-validation-run");
    let lacking = module(&folder, "lacking.spv", "");
    let scene = folder.join("scene.toml");
    fs::write(&scene, SCENE).expect("a writable folder");
    warns(&anyhit(&["run", text(&lacking), "--buffer", "0=8"]), 0);
    rejects(&anyhit(&["run", text(&lacking), "--buffer", "0=8", "--strict"]));
    warns(&anyhit(&["smoke", text(&lacking)]), 0);
    rejects(&anyhit(&["smoke", text(&lacking), "--strict"]));
    warns(&anyhit(&["run", text(&scene), "--dump", "out"]), 0);
    rejects(&anyhit(&["run", text(&scene), "--dump", "out", "--strict"]));
    // Three widths run it.
    warns(&anyhit(&["test", text(&folder)]), 0);
    let ran = anyhit(&["test", text(&folder), "--strict"]);
    assert_eq!(ran.code, Some(2), "{ran:?}");
    assert!(ran.out.contains(MISSING), "{ran:?}");
}

/// Of mutants that a compiler's author could have made, `Module::validate` reports those that lack
/// a declaration, and it answers for each.
#[test]
fn a_dropped_declaration_is_found() {
    let mut found = 0;
    for name in ["pass/sphere/closest-hit/main.rchit.spv", "pass/ray-query/compute/main.comp.spv"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures").join(name);
        let bytes = fs::read(path).expect("a fixture");
        assert_eq!(module::load(&bytes).expect("it loads").validate(), [], "{name}");
        let words: Vec<u32> =
            bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().expect("four"))).collect();
        let original = Original::new(&words).expect("known instructions");
        for number in 0..64 {
            let (mutant, story) = original.declaration_mutant(&mut Random::of(name, number));
            let bytes: Vec<u8> = mutant.iter().flat_map(|word| word.to_le_bytes()).collect();
            let Ok(module) = module::load(&bytes) else { continue };
            let findings = module.validate();
            // Each declares what it uses and no more; the others imply `Shader` (1).
            let is_other = !story.contains(',') && !story.ends_with("(1)");
            if story.starts_with("Capability dropped") && is_other {
                assert!(!findings.is_empty(), "{name} #{number}: {story}");
                found += 1;
            }
        }
    }
    assert!(found > 5, "only {found} mutants of this kind");
}
