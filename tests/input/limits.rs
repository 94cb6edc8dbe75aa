//! The limits of running from outside: commands that run shaders without end stop soon, and say
//! where, why and how to raise the limit.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit_engine::module;
use anyhit_engine::pipeline::{Compute, RunOptions};
use anyhit_engine::program::Program;

use crate::support::assembly::assemble;

/// In which an endless launch ends, with the start of the program and on a busy machine. Without
/// optimization the observers of a smoke run cost many times as much.
const SOON: Duration = Duration::from_secs(if cfg!(debug_assertions) { 20 } else { 10 });

/// Runs a command that must end soon; its exit code and what it prints to both streams.
fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let begin = Instant::now();
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    if arguments[0] == "test" {
        // The target folder, where scenes are written, need not lie in the repository.
        command.args(["--root", "/"]);
    }
    let output = command.output().expect("the command starts");
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8")).concat();
    assert!(begin.elapsed() < SOON, "after {:?}: {text}", begin.elapsed());
    (output.status.code(), text)
}

/// A file of this test's own in the folder for temporary files.
fn scratch(name: &str, text: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("limits");
    std::fs::create_dir_all(&folder).expect("a writable folder");
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a writable folder");
    path
}

fn assert_all(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is missing in:\n{text}");
    }
}

/// A scene of the endless loop of `shaders/fail/control-flow/endless-loop`, where launch index
/// x = 3 never leaves its loop.
fn scene(name: &str, launch: &str, pipeline: &str) -> PathBuf {
    let module =
        concat!(env!("CARGO_MANIFEST_DIR"), "/spirv-fixtures/fail/control-flow/endless-loop/main.rgen.spv")
            .replace('\\', "/");
    let text = format!(
        "version = 1\nlaunch = {launch}\n[shaders]\nraygen = '{module}'\n[pipeline]\nraygen = 'raygen'\n{pipeline}\n\
         [resources.outputs]\ntype = 'storage_buffer'\nbinding = 1\nsize = 65536\n[expect]\n"
    );
    scratch(name, &text)
}

#[test]
fn a_test_with_an_endless_loop_ends_soon_and_tells_of_the_loop() {
    let scene = scene("endless.toml", "[64, 256]", "");
    let (code, text) = run(&["test", scene.to_str().expect("a path in UTF-8")]);
    assert_eq!(code, Some(3), "{text}");
    assert_all(&text, &["an endless loop?", "main.rgen:1", "the loop at ", "`steps`"]);
}

#[test]
fn smoke_ends_an_endless_loop_soon() {
    let (code, text) = run(&["smoke", "spirv-fixtures/fail/control-flow/endless-loop/main.rgen.spv"]);
    assert!(code.is_some(), "{text}");
    assert_all(&text, &["ran out of fuel", "`steps`"]);
}

#[test]
fn every_limit_is_set_on_the_command_line() {
    let scene = scene("flags.toml", "[64, 256]", "");
    let scene = scene.to_str().expect("a path in UTF-8");
    for command in ["run", "test"] {
        for (flags, told) in [
            (&["--fuel", "100000"][..], &["the invocation ran out of fuel", "fuel = 100000 ", "--fuel"][..]),
            (
                &["--launch-fuel", "5000000", "--batch-timeout", "none"],
                &["the launch ran out of fuel", "launch_fuel = 5000000 ", "--launch-fuel"],
            ),
            (
                &["--timeout", "0.3", "--fuel", "1000000000000", "--launch-fuel", "none"],
                &["the launch ran out of time", "timeout = 0.3 s", "depends on the machine", "--timeout"],
            ),
            (
                &["--batch-timeout", "0.3", "--fuel", "1000000000000", "--launch-fuel", "none"],
                &["ran out of time", "batch_timeout = 0.3 s", "--batch-timeout"],
            ),
        ] {
            let (code, text) = run(&[&[command, scene], flags].concat());
            assert_eq!(code, Some(3), "{text}");
            assert_all(&text, told);
        }
    }
}

#[test]
fn limits_are_keys_of_a_scene() {
    for (keys, told) in [
        ("fuel = 70000", "fuel = 70000 "),
        ("fuel = 1000000000000\nlaunch_fuel = 900000", "launch_fuel = 900000 "),
    ] {
        let scene = scene("keys.toml", "8", keys);
        let (code, text) = run(&["run", scene.to_str().expect("a path in UTF-8")]);
        assert_eq!(code, Some(3), "{text}");
        assert_all(&text, &[told, "[pipeline]"]);
    }
    for (keys, told) in [
        ("max_callable_depth = 0", "max_callable_depth is 0"),
        ("max_callable_depth = 1000000", "expected 1 to 16384"),
        ("max_recursion_depth = 1000000", "exceeds the limit 1024"),
    ] {
        let scene = scene("deep.toml", "8", keys);
        let (code, text) = run(&["run", scene.to_str().expect("a path in UTF-8")]);
        assert_eq!(code, Some(2), "{text}");
        assert_all(&text, &[told]);
    }
    let scene = scene("recursion.toml", "8", "");
    let (code, text) =
        run(&["run", "--max-recursion-depth", "1000000", scene.to_str().expect("a path in UTF-8")]);
    assert_eq!(code, Some(2), "{text}");
    assert_all(&text, &["recursion depth 1000000 exceeds the limit 1024"]);
}

/// Which limit stops a launch first depends on how many invocations run side by side.
#[test]
fn endless_loops_are_no_difference_between_widths() {
    let scene = scene("widths.toml", "64", "fuel = 2000000\nlaunch_fuel = 3000000");
    let path = scene.to_str().expect("a path in UTF-8");
    let (code, text) = run(&["test", path, "--all-widths", "--check-optimizer"]);
    assert_eq!(code, Some(3), "{text}");
    assert_all(&text, &["an endless loop?"]);
    assert!(!text.contains("disagree") && !text.contains("bug in anyhit"), "{text}");
}

/// Many short invocations, each far below its own limits and those of its batch: a launch of rays
/// and a dispatch, of which no shader has a loop.
#[test]
fn a_launch_of_too_many_short_invocations_ends_by_its_own_clock() {
    let module = |stage: &str, more: &str| {
        assemble(&format!(
            "OpCapability Shader
             {more}
             OpMemoryModel Logical GLSL450
             OpEntryPoint {stage} %main \"main\"
             {}
             OpDecorate %Out Block
             OpMemberDecorate %Out 0 Offset 0
             OpDecorate %out DescriptorSet 0
             OpDecorate %out Binding 1
             %void = OpTypeVoid
             %function = OpTypeFunction %void
             %uint = OpTypeInt 32 0
             %0 = OpConstant %uint 0
             %Out = OpTypeStruct %uint
             %ptr_Out = OpTypePointer StorageBuffer %Out
             %ptr_uint = OpTypePointer StorageBuffer %uint
             %out = OpVariable %ptr_Out StorageBuffer
             %main = OpFunction %void None %function
             %begin = OpLabel
             %first = OpAccessChain %ptr_uint %out %0
             OpStore %first %0
             OpReturn
             OpFunctionEnd",
            if stage == "GLCompute" { "OpExecutionMode %main LocalSize 64 1 1" } else { "" }
        ))
    };
    let compute = scratch("short.comp.spv", "");
    std::fs::write(&compute, module("GLCompute", "")).expect("a writable folder");
    let rays = scratch("short.rgen.spv", "");
    let ray_tracing = "OpCapability RayTracingKHR\nOpExtension \"SPV_KHR_ray_tracing\"";
    std::fs::write(&rays, module("RayGenerationKHR", ray_tracing)).expect("a writable folder");
    let out = "[resources.outputs]\ntype = 'storage_buffer'\nbinding = 1\nsize = 4\n[expect]\n";
    let dispatch =
        "[shaders]\nmain = 'short.comp.spv'\n[[dispatch]]\nshader = 'main'\ngroups = [16777215, 255, 1]\n";
    let launch =
        "launch = [32768, 32768, 1]\n[shaders]\nmain = 'short.rgen.spv'\n[pipeline]\nraygen = 'main'\n";
    for (name, text) in [("short-dispatch.toml", dispatch), ("short-launch.toml", launch)] {
        let scene = scratch(name, &format!("version = 1\n{text}{out}"));
        let scene = scene.to_str().expect("a path in UTF-8");
        for arguments in [&["test", scene][..], &["run", scene], &["test", scene, "--sanitize"]] {
            let (code, text) = run(&[arguments, &["--timeout", "0.5", "--launch-fuel", "none"]].concat());
            assert_eq!(code, Some(3), "{text}");
            assert_all(&text, &["the launch ran out of time", "timeout = 0.5 s", "--timeout"]);
        }
        // The fuel of all of them is the same on every machine.
        let (code, text) = run(&["test", scene, "--launch-fuel", "100000"]);
        assert_eq!(code, Some(3), "{text}");
        assert_all(&text, &["the launch ran out of fuel", "launch_fuel = 100000 "]);
    }
}

/// Within the loop `tripled` is 3 n. It is used in one turn alone, so that its register may hold
/// something else by the end of it: 5 n and then the sum of both, written as often as 3 n is.
#[test]
fn a_loop_tells_no_numbers_of_other_values() {
    let bytes = assemble(
        "OpCapability Shader
         OpMemoryModel Logical GLSL450
         OpEntryPoint GLCompute %main \"main\" %out
         OpExecutionMode %main LocalSize 1 1 1
         OpName %n \"n\"
         OpName %tripled \"tripled\"
         OpDecorate %Out Block
         OpMemberDecorate %Out 0 Offset 0
         OpDecorate %out DescriptorSet 0
         OpDecorate %out Binding 0
         %void = OpTypeVoid
         %function = OpTypeFunction %void
         %uint = OpTypeInt 32 0
         %0 = OpConstant %uint 0
         %1 = OpConstant %uint 1
         %3 = OpConstant %uint 3
         %5 = OpConstant %uint 5
         %Out = OpTypeStruct %uint
         %ptr_Out = OpTypePointer StorageBuffer %Out
         %ptr_out = OpTypePointer StorageBuffer %uint
         %ptr_uint = OpTypePointer Function %uint
         %out = OpVariable %ptr_Out StorageBuffer
         %main = OpFunction %void None %function
         %begin = OpLabel
         %tripled = OpVariable %ptr_uint Function
         %n = OpVariable %ptr_uint Function
         %first = OpAccessChain %ptr_out %out %0
         OpStore %n %0
         OpBranch %head
         %head = OpLabel
         OpLoopMerge %end %continue None
         OpBranch %body
         %body = OpLabel
         %a = OpLoad %uint %n
         %b = OpIMul %uint %a %5
         %c = OpIMul %uint %a %3
         OpStore %tripled %c
         OpBranch %second
         %second = OpLabel
         %d = OpLoad %uint %tripled
         %e = OpIAdd %uint %b %d
         OpStore %first %e
         OpStore %tripled %c
         OpBranch %third
         %third = OpLabel
         %h = OpLoad %uint %tripled
         OpStore %first %h
         OpBranch %continue
         %continue = OpLabel
         %f = OpLoad %uint %n
         %g = OpIAdd %uint %f %1
         OpStore %n %g
         OpBranch %head
         %end = OpLabel
         OpReturn
         OpFunctionEnd",
    );
    let module = Arc::new(module::load(&bytes).expect("a module"));
    let program = Arc::new(Program::of(&module, "main").expect("a program"));
    let mut resources = Resources::default();
    resources.descriptors.insert(Binding { set: 0, binding: 0 }, vec![Descriptor::Buffer(Buffer::zeroed(4))]);
    let compute = Compute::new(program).expect("a compute shader").fuel(100_000);
    let error =
        compute.run(&resources, [1; 3], RunOptions::default()).expect_err("a loop without an end").render();
    let range = |name: &str| -> Option<[u32; 2]> {
        let (_, told) = error.split_once(&format!("`{name}` changed from "))?;
        let (from, told) = told.split_once(" to ")?;
        let to = told.split(|other: char| !other.is_ascii_digit()).next()?;
        Some([from.parse().ok()?, to.parse().ok()?])
    };
    let n = range("n").unwrap_or_else(|| panic!("{error}"));
    // At the end of a turn `n` is one more already.
    if let Some(tripled) = range("tripled") {
        assert_eq!(tripled, n.map(|n| 3 * (n - 1)), "{error}");
    }
}

#[test]
fn help_lists_the_limits_of_every_command_that_runs_shaders() {
    const ALL: [&str; 8] = [
        "--fuel",
        "--launch-fuel",
        "--timeout",
        "--batch-timeout",
        "--max-recursion-depth",
        "--max-callable-depth",
        "--max-stack-size",
        "--printed-bytes",
    ];
    for (command, limits) in
        [("run", &ALL[..]), ("render", &ALL), ("test", &ALL), ("trace-one-ray", &ALL), ("smoke", &ALL[..4])]
    {
        assert_all(&run(&[command, "--help"]).1, limits);
    }
}

/// Compute shaders in WGSL, which need no compiler beside this crate.
#[cfg(feature = "wgsl")]
mod wgsl {
    use super::*;

    const HEAD: &str = "@group(0) @binding(0) var<storage, read_write> count: atomic<u32>;\n";

    #[test]
    fn a_barrier_loop_over_a_large_workgroup_ends() {
        let shader = scratch(
            "barriers.wgsl",
            &format!(
                "{HEAD}@compute @workgroup_size(1024) fn main() {{
    var turn = 0u;
    while true {{
        workgroupBarrier();
        turn += 1u;
        if turn == 0u {{ break; }}
    }}
    atomicAdd(&count, turn);
}}
"
            ),
        );
        let path = shader.to_str().expect("a path in UTF-8");
        let scene = scratch(
            "barriers.toml",
            "version = 1\n[shaders]\nmain = 'barriers.wgsl'\n[[dispatch]]\nshader = 'main'\n\
             [resources.count]\ntype = 'storage_buffer'\nbinding = 0\nsize = 4\n[expect]\n",
        );
        let (code, text) = run(&["test", scene.to_str().expect("a path in UTF-8")]);
        assert_eq!(code, Some(3), "{text}");
        assert_all(&text, &["an endless loop?", "barriers.wgsl:", "the loop at ", "`turn`"]);
        let (code, text) = run(&["smoke", path]);
        assert_eq!(code, Some(1), "{text}");
        assert_all(&text, &["an endless loop?", "barriers.wgsl:"]);
    }

    #[test]
    fn a_small_module_of_many_calls_ends() {
        // 2^40 calls of the last function, in some 3 KB.
        let functions: String =
            (0..40).map(|at| format!("fn f{at}() {{ f{next}(); f{next}(); }}\n", next = at + 1)).collect();
        let text = format!(
            "{HEAD}fn f40() {{ atomicAdd(&count, 1u); }}\n{}@compute @workgroup_size(1) fn main() {{ f0(); }}\n",
            functions.lines().rev().fold(String::new(), |all, line| all + line + "\n")
        );
        let shader = scratch("calls.wgsl", &text);
        let path = shader.to_str().expect("a path in UTF-8");
        let (code, text) = run(&["smoke", path]);
        assert_eq!(code, Some(1), "{text}");
        assert_all(&text, &["ran out of fuel"]);
        let (code, text) = run(&["run", path, "--fuel", "1000000"]);
        assert_eq!(code, Some(3), "{text}");
        assert_all(&text, &["fuel = 1000000 "]);
    }
}
