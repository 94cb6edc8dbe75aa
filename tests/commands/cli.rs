//! The command line from outside: exit codes, what is printed where, pipes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use pretty_assertions::assert_eq;
use serde_json::{Value, json};

use crate::support::skipped::{self, test_name};

const GRASS: &str = "spirv-fixtures/demo/swept-spheres/grass.rchit.spv";

fn anyhit(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    command
}

fn run(arguments: &[&str]) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = anyhit(arguments).output().expect("the command starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (status.code(), text(stdout), text(stderr))
}

/// A file of this test's own in the folder for temporary files.
fn scratch(name: &str, bytes: &[u8]) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, bytes).expect("a writable folder");
    path
}

#[test]
fn exit_codes_and_streams() {
    let (code, out, err) = run(&["--version"]);
    assert_eq!((code, err.as_str()), (Some(0), ""));
    assert_eq!(out, format!("anyhit {}\n", env!("CARGO_PKG_VERSION")));

    let (code, out, err) = run(&["inspct"]);
    assert_eq!((code, out.as_str()), (Some(2), ""));
    assert!(err.contains("'inspect'"), "{err}");

    let (code, out, err) = run(&["inspect", "no/such/file.spv"]);
    assert_eq!((code, out.as_str()), (Some(2), ""));
    assert!(err.starts_with("error: no/such/file.spv: "), "{err}");
    assert!(!err.contains('\u{1b}'), "no colour where no terminal is: {err}");
}

/// The rule of <https://bixense.com/clicolors> and <https://no-color.org>, for errors, explanations
/// and clap's answers, none of which goes to a terminal here.
#[test]
fn one_rule_decides_on_colours() {
    const SCENE: &str = "tests/debugger/trace-one-ray/sphere.toml";
    let commands: [&[&str]; 4] =
        [&["inspect", "no/such.spv"], &["trace-one-ray", SCENE], &["inspct"], &["inspect", "--help"]];
    let is_coloured = |arguments: &[&str], variables: &[(&str, &str)]| {
        let mut command = anyhit(arguments);
        for variable in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
            command.env_remove(variable);
        }
        let Output { stdout, stderr, .. } =
            command.envs(variables.iter().copied()).output().expect("the command starts");
        stdout.contains(&0x1b) || stderr.contains(&0x1b)
    };
    for command in commands {
        let with = |more: &[&'static str]| [command, more].concat();
        let forced = [("CLICOLOR_FORCE", "1")];
        assert!(!is_coloured(command, &[]), "{command:?}");
        assert!(is_coloured(command, &forced), "{command:?}");
        assert!(!is_coloured(command, &[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]), "{command:?}");
        assert!(is_coloured(&with(&["--color=always"]), &[("NO_COLOR", "1")]), "{command:?}");
        assert!(is_coloured(&with(&["--color", "always"]), &[]), "{command:?}");
        assert!(!is_coloured(&with(&["--color", "never"]), &forced), "{command:?}");
        assert!(is_coloured(&with(&["--color", "auto"]), &forced), "{command:?}");
    }
    let (code, _, err) = run(&["inspect", GRASS, "--color", "sometimes"]);
    assert_eq!(code, Some(2));
    assert!(err.contains("[possible values: auto, always, never]"), "{err}");
}

#[test]
fn inspect_lists_what_a_module_declares() {
    let (code, out, _) = run(&["inspect", "--json", GRASS]);
    assert_eq!(code, Some(0));
    let report: Value = serde_json::from_str(&out).expect("JSON");
    let entry = &report["entry_points"][0];
    // What grass.rchit declares, and `spirv-dis` shows of it.
    assert_eq!(entry["name"], "main");
    assert_eq!(entry["stage"], "ClosestHitKHR");
    assert_eq!(entry["supported"], true);
    assert_eq!(entry["reasons"], json!([]));
    let interface = entry["interface"].as_array().expect("a list");
    let named = |name: &str| interface.iter().find(|variable| variable["name"] == name);
    assert_eq!(
        named("palette"),
        Some(&json!({
            "name": "palette", "storage_class": "UniformConstant", "type": "sampled image",
            "set": 0, "binding": 3,
        }))
    );
    assert_eq!(
        named("gl_HitLSSPositionsNV"),
        Some(&json!({
            "name": "gl_HitLSSPositionsNV", "storage_class": "Input", "type": "vec3[2]",
            "builtin": "HitLSSPositionsNV",
        }))
    );
    let capabilities = report["capabilities"].as_array().expect("a list");
    assert!(capabilities.contains(&json!("RayTracingLinearSweptSpheresGeometryNV")));
}

#[test]
fn inspect_tells_everything_that_would_not_run() {
    let module = refused_module();
    let path = scratch("refused.spv", &module);
    let (code, out, _) = run(&["inspect", "--json", path.to_str().expect("UTF-8")]);
    assert_eq!(code, Some(0), "what is not supported is a finding, not an error");
    let report: Value = serde_json::from_str(&out).expect("JSON");
    let entry = &report["entry_points"][0];
    assert_eq!((&entry["name"], &entry["stage"]), (&json!("hit"), &json!("ClosestHitKHR")));
    assert_eq!(entry["supported"], false);
    assert_eq!(
        entry["reasons"],
        json!([
            "the builtin RemainingRecursionLevelsAMDX is out of scope (work graphs: neither ray-tracing nor \
             compute pipelines) (at word 39)",
            "OpDemoteToHelperInvocation is out of scope (graphics stages) (2 times, first at word 54)",
        ])
    );
}

/// VUID-StandaloneSpirv-VulkanMemoryModel-04678: RayTmaxKHR of an intersection shader is Volatile
/// there. Slang leaves it out.
#[test]
fn what_is_undefined_in_any_run_is_told_without_being_asked() {
    const BALL: &str = "spirv-fixtures/sanitize/volatile-raytmax/broken.slang.spv";
    let (code, out, _) = run(&["inspect", "--json", BALL]);
    let report: Value = serde_json::from_str(&out).expect("JSON");
    let finding = &report["entry_points"][0]["findings"][0];
    assert_eq!(
        (code, &finding["rule"], &finding["level"]),
        (Some(0), &json!("volatile-raytmax"), &json!("deny"))
    );
    let (_, out, _) = run(&["inspect", BALL]);
    assert!(
        out.contains("\n  error[volatile-raytmax]: the variable of RayTmaxKHR is not Volatile\n"),
        "{out}"
    );

    // A test passes all the same, unless the sanitizer is asked.
    let case = "shaders/sanitize/volatile-raytmax";
    let (code, out, _) = run(&["test", case]);
    assert_eq!(code, Some(0), "{out}");
    assert!(out.contains("warning[volatile-raytmax]: "), "{out}");
    let (code, out, _) = run(&["test", case, "--format", "json"]);
    let report: Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!((code, &report["findings"][0]["level"]), (Some(0), &json!("warn")));
    let (code, out, _) = run(&["test", case, "--sanitize"]);
    assert_eq!(code, Some(6), "{out}");

    // It depends on no input that `smoke` makes up.
    let (code, out, _) = run(&["smoke", BALL]);
    assert_eq!((code, out.contains("error[")), (Some(0), false), "{out}");
    let (code, out, err) = run(&["smoke", BALL, "--sanitize"]);
    assert_eq!((code, err.trim_end()), (Some(6), "error: 1 finding is denied"), "{out}");
}

/// A folder with scenes that each divide by zero twice: `one` and `same` with the same module, and
/// `other` with one that has as many words, but another generator in its header.
fn suite_of_divisions(name: &str) -> PathBuf {
    const MODULE: &str = "spirv-fixtures/sanitize/int-div-zero/broken.slang.spv";
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    let mut other = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(MODULE)).expect("a module");
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("one.spv"), &other).expect("written");
    other[8] ^= 0xFF;
    std::fs::write(folder.join("other.spv"), &other).expect("written");
    for (case, module) in [("one", "one"), ("other", "other"), ("same", "one")] {
        let text = format!(
            "version = 1\n[shaders]\nall = \"../{module}.spv\"\n[[dispatch]]\nshader = \"all:mean_colors\"\n\
             [resources.palette]\ntype = \"storage_buffer\"\nbinding = 1\nsize = 16\n\
             [resources.clusters]\ntype = \"storage_buffer\"\nbinding = 2\n\
             data = {{ u32 = [[800, 400, 0, 8], [0, 0, 0, 0], [255, 255, 255, 1], [90, 60, 30, 3]] }}\n"
        );
        std::fs::create_dir_all(folder.join(case)).expect("a folder");
        std::fs::write(folder.join(case).join("scene.toml"), text).expect("written");
    }
    folder
}

/// A module without its debug instructions (SPIR-V, "Debug Instructions").
fn without_debug(bytes: &[u8]) -> Vec<u8> {
    let words: Vec<u32> =
        bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
    let (header, mut rest) = words.split_at(5);
    let mut kept = header.to_vec();
    while let [first, ..] = *rest {
        let (instruction, behind) = rest.split_at((first >> 16) as usize);
        if !matches!(first as u16, 2..=8 | 317 | 330) {
            kept.extend(instruction);
        }
        rest = behind;
    }
    kept.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Whether a shader without its source declared a payload that an optimizer has dropped, nobody
/// knows: that it declares none is told, and not denied.
#[test]
fn a_payload_that_may_have_been_dropped_is_a_warning() {
    const CASE: &str = "shaders/sanitize/payload-undeclared/scene.toml";
    const SHADER: &str = "spirv-fixtures/sanitize/payload-undeclared/broken.rahit.spv";
    let (code, out, _) = run(&["run", CASE, "--sanitize"]);
    assert_eq!((code, out.contains("error[payload-undeclared]")), (Some(6), true), "{out}");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let module = without_debug(&std::fs::read(root.join(SHADER)).expect("a module"));
    let module = scratch("without-debug.rahit.spv", &module);
    let text = std::fs::read_to_string(root.join(CASE)).expect("a scene");
    let text = text.replace(&format!("../../../{SHADER}"), module.to_str().expect("UTF-8"));
    let text = text.replace("../../..", root.to_str().expect("UTF-8"));
    let scene = scratch("without-debug.toml", text.as_bytes());
    let (code, out, err) = run(&["run", scene.to_str().expect("UTF-8"), "--sanitize"]);
    assert_eq!((code, out.contains("warning[payload-undeclared]")), (Some(0), true), "{out}{err}");
    assert!(out.contains("an optimizer may have removed an unused declaration"), "{out}");
}

/// What stands at the same word of two modules is two mistakes, and what two scenes run of one
/// module is one.
#[test]
fn findings_of_several_scenes_are_told_apart_by_their_modules() {
    let folder = suite_of_divisions("divisions");
    let folder = folder.to_str().expect("UTF-8");
    let counts = |args: &[&str]| {
        let (code, out, err) = run(args);
        let findings: Vec<Value> =
            serde_json::from_str(&out).unwrap_or_else(|error| panic!("{error}: {out}{err}"));
        assert!(
            err.contains("tests failed") || err.contains("failed"),
            "the report is on standard error: {err}"
        );
        let counts: Vec<u64> = findings.iter().filter_map(|one| one["count"].as_u64()).collect();
        assert!(findings.iter().all(|one| one["rule"] == "int-div-zero" && one["level"] == "deny"), "{out}");
        (code, counts)
    };
    // Three components are divided by zero in each of the three scenes.
    let expected = (Some(6), vec![6, 3]);
    assert_eq!(counts(&["test", folder, "--sanitize", "--findings", "json"]), expected);
    // Shares have the same to tell.
    let shares: Vec<String> = (1..=2)
        .map(|number| {
            let file = format!("{folder}/share{number}.json");
            let shard = format!("{number}/2");
            let (code, out, err) = run(&["test", folder, "--sanitize", "--shard", &shard, "--result", &file]);
            assert_eq!(code, Some(6), "{out}{err}");
            file
        })
        .collect();
    let merge = ["merge", &shares[0], &shares[1], "--findings"];
    assert_eq!(counts(&[&merge[..], &["json"]].concat()), expected);
    let (_, whole, _) = run(&["test", folder, "--sanitize", "--findings", "sarif"]);
    let (_, merged, _) = run(&[&merge[..], &["sarif"]].concat());
    assert!(whole.contains("\"ruleId\": \"int-div-zero\""), "{whole}");
    assert_eq!(merged, whole);
}

/// Text, JSON and annotations name the module of each finding. Where no debug information names a
/// source, the module is the place of a result.
#[test]
fn findings_name_their_modules() {
    let folder = suite_of_divisions("named-modules");
    let module = folder.join("one.spv");
    let scene = folder.join("one/scene.toml");
    let scene = scene.to_str().expect("UTF-8");
    let run = |more: &[&str]| {
        let (code, out, err) = run(&[&["run", scene, "--sanitize"], more].concat());
        assert_eq!(code, Some(6), "{out}{err}");
        out
    };
    let parsed = |text: String| -> Value { serde_json::from_str(&text).expect("JSON") };
    for is_bare in [false, true] {
        if is_bare {
            let bytes = std::fs::read(&module).expect("a module");
            std::fs::write(&module, without_debug(&bytes)).expect("written");
        }
        let text = run(&[]);
        assert!(text.contains("/named-modules/one.spv"), "{text}");
        assert!(!text.contains(".."), "{text}");
        let json = parsed(run(&["--findings", "json"]));
        let findings = json.as_array().expect("findings");
        assert!(!findings.is_empty());
        for finding in findings {
            assert!(finding["module"].as_str().is_some_and(|path| path.ends_with("/one.spv")), "{finding}");
        }
        let annotations = run(&["--findings", "github"]);
        for line in annotations.lines().filter(|line| line.starts_with("::error")) {
            let place = if is_bare { "one.spv,title=" } else { ".slang,line=" };
            assert!(line.contains(place) && line.contains("%0Ain module "), "{line}");
        }
        assert_eq!(annotations.matches("::error").count(), findings.len(), "{annotations}");
        let sarif = parsed(run(&["--findings", "sarif"]));
        let log = &sarif["runs"][0];
        let rules = log["tool"]["driver"]["rules"].as_array().expect("rules");
        for result in log["results"].as_array().expect("results") {
            let place = &result["locations"][0]["physicalLocation"];
            let uri = place["artifactLocation"]["uri"].as_str().expect("a place");
            assert!(uri.ends_with(if is_bare { "/one.spv" } else { ".slang" }), "{uri}");
            assert_eq!(place["region"]["startColumn"].is_u64(), !is_bare, "{place}");
            let rule = result["ruleIndex"].as_u64().expect("the index of a rule");
            assert_eq!(rules[rule as usize]["id"], result["ruleId"]);
            let prints = result["partialFingerprints"].as_object().expect("fingerprints");
            assert!(prints.values().all(Value::is_string) && !prints.is_empty(), "{result}");
        }
    }
}

/// Known findings fail no test, and others do.
#[test]
fn a_baseline_keeps_known_findings_out_of_a_suite() {
    let folder = suite_of_divisions("known-divisions");
    let baseline = folder.join("known.txt");
    let (folder, baseline) = (folder.to_str().expect("UTF-8"), baseline.to_str().expect("UTF-8"));
    let (code, out, err) = run(&["test", folder, "--sanitize", "--write-baseline", baseline]);
    assert_eq!(code, Some(0), "{out}{err}");
    let known = std::fs::read_to_string(baseline).expect("a baseline");
    let lines: Vec<&str> = known.lines().collect();
    assert!(matches!(lines[..], [line] if line.starts_with("int-div-zero\t")), "{known}");
    let (code, out, err) = run(&["test", folder, "--sanitize", "--baseline", baseline]);
    assert_eq!((code, out.contains("int-div-zero")), (Some(0), false), "{out}{err}");
    std::fs::write(baseline, known.replace("int-div-zero", "shift-width")).expect("written");
    let (code, ..) = run(&["test", folder, "--sanitize", "--baseline", baseline]);
    assert_eq!(code, Some(6));
}

#[test]
fn the_command_of_a_drawn_choice_has_what_the_run_had() {
    let root = env!("CARGO_MANIFEST_DIR");
    let text = format!(
        r#"version = 1
[shaders]
main = "{root}/spirv-fixtures/many-seeds/undefined-drawn/broken.comp.spv"
[[dispatch]]
shader = "main"
[resources.depths]
type = "storage_buffer"
binding = 1
data = {{ f32 = [1, 2, 3, 4, 5, 6, 8, 16] }}
[resources.picture]
type = "storage_buffer"
binding = 2
size = 128
[[variant]]
name = "far away"
"#
    );
    let scene = scratch("drawn-variant.toml", text.as_bytes());
    let scene = scene.to_str().expect("UTF-8");
    let (code, out, err) =
        run(&["run", scene, "--variant", "far away", "--memory", "robust", "--many-seeds", "4"]);
    assert_eq!(code, Some(6), "{out}{err}");
    let told = format!("anyhit run {scene} --variant \"far away\" --memory robust --seed-range ");
    assert!(out.contains(&told), "{out}");
    let seed = out.split("--seed-range ").nth(1).and_then(|rest| rest.split_whitespace().next());
    let again = ["--variant", "far away", "--memory", "robust", "--seed-range", seed.expect("a seed")];
    let (code, _, err) = run(&[&["run", scene][..], &again].concat());
    assert_eq!(code, Some(6), "{err}");
}

/// For machines a trap and a limit stand among the findings; in text they are the error at the end.
#[test]
fn what_ends_a_sanitized_run_is_a_finding_with_a_class() {
    let found = |case: &str| {
        let scene = format!("shaders/fail/{case}/scene.toml");
        let (code, out, _) = run(&["run", &scene, "--sanitize", "--findings", "json"]);
        let findings: Value = serde_json::from_str(&out).expect("JSON");
        let last = findings.as_array().and_then(|all| all.last()).expect("a finding").clone();
        (code, last["rule"].clone(), last["class"].clone())
    };
    assert_eq!(found("trace/invalid-ray"), (Some(3), json!("ray-nan"), json!("bug")));
    assert_eq!(found("control-flow/endless-loop"), (Some(3), json!("loop-endless"), json!("stop")));
}

#[test]
#[cfg(feature = "wgsl")]
fn inspect_compiles_a_source() {
    let text = "@compute @workgroup_size(2) fn nothing() {}\n";
    let path = scratch("nothing.wgsl", text.as_bytes());
    let (code, out, err) = run(&["inspect", path.to_str().expect("UTF-8")]);
    assert_eq!((code, err.as_str()), (Some(0), ""));
    assert!(out.contains("GLCompute `nothing`: supported"), "{out}");
    let path = scratch("nothing.txt", text.as_bytes());
    let (code, out, err) = run(&["inspect", path.to_str().expect("UTF-8")]);
    assert_eq!((code, out.as_str()), (Some(2), ""));
    assert!(err.contains("is text, not a SPIR-V module") && err.contains("or `--language`"), "{err}");
    let (code, out, _) = run(&["inspect", "--language", "wgsl", path.to_str().expect("UTF-8")]);
    assert_eq!(code, Some(0));
    assert!(out.contains("GLCompute `nothing`: supported"), "{out}");
}

#[test]
fn garbled_modules_are_refused_with_a_place() {
    let path = scratch("cut.spv", &refused_module()[..100]);
    let (code, _, err) = run(&["inspect", path.to_str().expect("UTF-8")]);
    assert_eq!(code, Some(2));
    assert!(err.contains("at word ") && err.contains("cut.spv"), "{err}");
}

/// `anyhit inspect ... | head`: the reader has left, the command ends in peace.
#[test]
fn a_reader_that_has_left_causes_no_error() {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let mut command = anyhit(&["inspect", "--json", GRASS]);
    let Output { status, stderr, .. } = command.stdout(writer).output().expect("the command starts");
    assert_eq!((status.code(), String::from_utf8_lossy(&stderr).as_ref()), (Some(0), ""));
}

/// A closest-hit shader that reads `RemainingRecursionLevelsAMDX` and demotes itself twice.
fn refused_module() -> Vec<u8> {
    let mut words = vec![0x0723_0203, 0x0001_0600, 0, 100, 0];
    let mut op = |opcode: u32, operands: &[u32]| {
        words.push((operands.len() as u32 + 1) << 16 | opcode);
        words.extend(operands);
    };
    op(17, &[4479]); // OpCapability RayTracingKHR
    op(14, &[0, 1]); // OpMemoryModel Logical GLSL450
    op(15, &[5316, 30, u32::from_le_bytes(*b"hit\0"), 20]); // OpEntryPoint ClosestHitKHR
    op(71, &[20, 11, 5021]); // OpDecorate %20 BuiltIn RemainingRecursionLevelsAMDX
    op(19, &[1]); // OpTypeVoid
    op(33, &[2, 1]); // OpTypeFunction
    op(21, &[5, 32, 0]); // OpTypeInt
    op(22, &[6, 32]); // OpTypeFloat
    op(43, &[6, 7, 0x3f80_0000]); // OpConstant 1.0
    op(32, &[10, 1, 5]); // OpTypePointer Input uint
    op(59, &[10, 20, 1]); // OpVariable Input
    op(54, &[1, 30, 0, 2]); // OpFunction
    op(248, &[31]); // OpLabel
    op(61, &[5, 32, 20]); // OpLoad
    op(5380, &[]); // OpDemoteToHelperInvocation
    op(5380, &[]); // OpDemoteToHelperInvocation
    op(253, &[]); // OpReturn
    op(56, &[]); // OpFunctionEnd
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

#[test]
fn run_shows_what_a_compute_shader_left() {
    const SUMS: &str = "spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";
    let (code, out, err) = run(&["run", SUMS, "--buffer", "1=1024"]);
    assert_eq!((code, err.as_str()), (Some(0), ""));
    // n (n + 1) / 2
    assert!(out.starts_with("set 0, binding 1 `Outputs`:\n  sums = [0, 1, 3, 6, 10, "), "{out}");
    assert!(out.ends_with(", 32385, 32640]\n"), "{out}");

    let (code, out, _) = run(&["run", SUMS, "--dump", "1=json", "--lanes", "128", "--stats"]);
    assert_eq!(code, Some(0));
    let mut lines = out.lines();
    let json: Value = serde_json::from_str(lines.next().unwrap_or_default()).expect("JSON");
    assert_eq!(json["value"]["sums"][255], 32_640);
    assert!(
        // Each batch of 128 lanes is full.
        lines.any(|line| line.starts_with("GLCompute")
            && line.contains("256 invocations in 2 batches, 128.0 lanes each"))
    );

    let (code, out, err) = run(&["run", SUMS, "--lanes", "8"]);
    assert_eq!((code, out.as_str()), (Some(2), ""));
    assert!(err.contains("[possible values: 1, 64, 128]"), "{err}");

    let (code, out, _) = run(&["run", "shaders/pass/compute/prefix-sum/scene.toml", "--dump", "sums=hex"]);
    assert_eq!(code, Some(0));
    assert!(out.contains("\n00000000  00 00 00 00 01 00 00 00 03 00 00 00 06 00 00 00\n"), "{out}");
}

#[test]
fn a_scene_that_shows_nothing_says_how_to_ask() {
    let scene = "shaders/pass/sphere/closest-hit/scene.toml";
    let (code, out, err) = run(&["run", scene]);
    assert_eq!((code, out.as_str()), (Some(0), ""));
    assert_eq!(err, "done; --dump WHAT prints the content of `outputs`, --stats prints statistics\n");
    let (code, out, err) = run(&["run", scene, "--dump", "outputs=hex"]);
    assert!(code == Some(0) && out.contains("outputs") && err.is_empty(), "{out}{err}");
}

#[test]
fn a_module_that_cannot_be_read_is_told_once() {
    let folder = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("told-once");
    std::fs::create_dir_all(&folder).expect("a writable folder");
    std::fs::write(folder.join("bad.spv"), [0; 20]).expect("a writable folder");
    let scene = folder.join("scene.toml");
    let hit = "hit = [{ closest_hit = 'bad' }, { closest_hit = 'bad', any_hit = 'bad' }]";
    std::fs::write(
        &scene,
        format!("version = 1\nlaunch = 1\nshaders = {{ bad = 'bad.spv' }}\n[pipeline]\n{hit}\n"),
    )
    .expect("a writable folder");
    let (code, _, err) = run(&["run", scene.to_str().expect("UTF-8")]);
    assert_eq!((code, err.matches("error:").count()), (Some(2), 1), "{err}");
}

#[test]
fn run_prints_what_shaders_print() {
    let (code, out, err) = run(&["run", "shaders/pass/compute/print/scene.toml"]);
    assert_eq!((code, err.as_str()), (Some(0), ""));
    // By dispatch order within an invocation, invocations in launch order.
    let expected = "invocation 1 of 0, 0: 0.500000, 1.500000\n\
                    invocation 1 of 0, 0: 0.500000, 2.500000\n\
                    invocation 3 of 1, 0: 1.500000, 2.500000\n";
    assert_eq!(out, expected);
    let shader = "spirv-fixtures/pass/compute/print/main.comp.spv";
    let (code, out, _) = run(&["run", shader, "--push", "f32 = 8", "--dump", "1"]);
    assert_eq!(code, Some(0));
    assert!(out.ends_with("  halves = [[0.0, 4.0], [0.5, 4.0]]\n"), "{out}");
}

#[test]
fn run_says_what_is_wrong_with_its_arguments() {
    let sums = "spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";
    let mistakes: &[(&[&str], &str)] = &[
        (&["--groups", "2,x"], "`--groups 2,x` is not X, X,Y or X,Y,Z"),
        (&["--entry", "mian"], "has no compute entry point `mian`"),
        (&["--buffer", "1={ f31 = 1 }"], "did you mean `f32`?"),
        (&["--dump", "sums=hx"], "`hx` is not typed, hex or json"),
        (&["--dump", "sms"], "`sms` is neither a resource of the scene nor a binding"),
        (&["--save", "1=a.png"], "the resource is not an image"),
    ];
    for (arguments, expected) in mistakes {
        let (code, out, err) = run(&[&["run", sums], *arguments].concat());
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments:?}");
        assert!(err.contains(expected), "{arguments:?}: {err}");
    }
    let (code, _, err) = run(&["run", GRASS]);
    assert_eq!(code, Some(2));
    assert!(err.contains("has no compute entry point") && err.contains("requires a scene file"), "{err}");
}

#[test]
fn a_picture_is_written_as_its_extension_says() {
    let folder = tempfile::tempdir().expect("a folder");
    let exr = if cfg!(feature = "exr") { (0, "") } else { (4, "neither reads nor writes OpenEXR") };
    let refused = "does not end in .png, .exr or .raw";
    for (name, (wanted, told), head) in [
        ("out.exr", exr, &b"\x76\x2f\x31\x01"[..]),
        ("out.bmp", (2, refused), b""),
        ("out.PNG", (0, ""), b"\x89PNG"),
        ("picture", (0, "the picture is"), b"\x89PNG"),
        ("out.raw", (0, ""), b""),
    ] {
        let path = folder.path().join(name);
        let (code, _, err) = run(&["render", "--size", "2x2", "-o", path.to_str().expect("text")]);
        assert_eq!((code, path.exists()), (Some(wanted), wanted == 0), "{name}: {err}");
        assert!(err.contains(told) || wanted == 0, "{name}: {err}");
        assert!(wanted != 0 || std::fs::read(&path).expect("it is there").starts_with(head), "{name}");
    }
    // Two by two texels of the demo's image, as `--dump` and `--save` write them, too.
    let raw = std::fs::read(folder.path().join("out.raw")).expect("it is there");
    assert!(raw.len().is_multiple_of(4) && [16, 32, 64].contains(&raw.len()), "{}", raw.len());
}

#[test]
fn a_dump_into_a_file_holds_the_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let sums = folder.path().join("sums.bin");
    let sums = sums.to_str().expect("text");
    let (code, out, err) = run(&[
        "run",
        "spirv-fixtures/pass/compute/print/main.comp.spv",
        "--push",
        "f32 = 8",
        "--dump",
        &format!("1={sums}"),
    ]);
    assert_eq!(code, Some(0), "{err}");
    assert!(!out.contains("halves"), "{out}");
    // [0, 4] and [0.5, 4], as the typed dump of the same run shows.
    let wanted: Vec<u8> = [0.0_f32, 4.0, 0.5, 4.0].iter().flat_map(|number| number.to_le_bytes()).collect();
    assert_eq!(std::fs::read(sums).expect("the dump"), wanted);
    let refused = format!("1={}", folder.path().join("no/such/folder/a.bin").display());
    let (code, _, err) = run(&["run", "spirv-fixtures/pass/compute/print/main.comp.spv", "--dump", &refused]);
    assert_eq!(code, Some(2));
    assert!(err.contains("a.bin"), "{err}");
}

/// A folder with a scene of one WGSL module, `main`.
#[cfg(feature = "wgsl")]
fn scene_folder(scene: &str, shaders: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let head =
        "[shaders]\nmain = 'main.wgsl'\n[resources.scene]\ntype = 'acceleration_structure'\nbinding = 0\n";
    let shaders = format!(
        "enable wgpu_ray_tracing_pipeline;
         @group(0) @binding(0) var scene: acceleration_structure;
         struct Payload {{ t: f32 }}
         var<ray_payload> payload: Payload;
         {shaders}"
    );
    for (name, text) in [("scene.toml", format!("version = 1\n{scene}\n{head}")), ("main.wgsl", shaders)] {
        std::fs::write(folder.path().join(name), text).expect("a writable folder");
    }
    folder
}

#[cfg(feature = "wgsl")]
#[test]
fn run_intersects_at_the_precision_that_is_asked_for() {
    // The sphere of radius 1 around 0 from 64 places on a line, obliquely.
    let folder = scene_folder(
        "precision = 'float'
         launch = 64
         [geometry.sphere]
         type = 'spheres'
         positions = [[0, 0, 0]]
         radii = 1.0
         [[instance]]
         geometry = 'sphere'
         [pipeline]
         raygen = 'main:look'
         miss = ['main:nothing']
         hit = [{ closest_hit = 'main:met' }]
         [resources.met]
         type = 'storage_buffer'
         binding = 1
         size = 256
        ",
        "@group(0) @binding(1) var<storage, read_write> out: array<f32>;
         var<incoming_ray_payload> incoming: Payload;
         @ray_generation
         fn look(@builtin(ray_invocation_id) id: vec3u) {
             let origin = vec3f(0.25 + f32(id.x) / 256.0, -1.5, 64.0);
             traceRay(scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.0, 100.0, origin, vec3f(-0.0078125, 0.015625, -1.0)), &payload);
             out[id.x] = payload.t;
         }
         @closest_hit @incoming_payload(incoming)
         fn met(@builtin(ray_t_current_max) t: f32) { incoming = Payload(t); }
         @miss @incoming_payload(incoming)
         fn nothing() { incoming = Payload(-1.0); }",
    );
    let scene = folder.path().join("scene.toml").display().to_string();
    let met = |more: &[&str]| -> Vec<f32> {
        let (code, out, err) = run(&[&["run", &scene, "--dump", "met=json"], more].concat());
        assert_eq!((code, err.as_str()), (Some(0), ""));
        let value: Value = serde_json::from_str(&out).expect("JSON");
        let list = value["value"]["_0"].as_array().expect("a list").iter();
        list.map(|number| number.as_f64().expect("a number") as f32).collect()
    };
    // a t^2 + 2 b t + c = 0 in f64, whose error is a millionth of a step of f32 here.
    let wanted: Vec<f32> = (0..64)
        .map(|number| {
            let (origin, way) =
                ([0.25 + f64::from(number) / 256.0, -1.5, 64.0], [-0.0078125, 0.015625, -1.0]);
            let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let (a, b, c) = (dot(way, way), dot(origin, way), dot(origin, origin) - 1.0);
            ((-b - (b * b - a * c).sqrt()) / a) as f32
        })
        .collect();
    assert_eq!(met(&["--precision", "exact"]), wanted);
    let float = met(&["--precision", "float"]);
    assert_eq!(met(&[]), float, "as the scene says");
    // Formulas in f32 are near, and not all of them right: a step is 2^-18.
    let steps = float.iter().zip(&wanted).map(|(float, wanted)| (float - wanted).abs() * 262_144.0);
    let most = steps.fold(0.0, f32::max);
    assert!((1.0..64.0).contains(&most), "{most}");
    let (code, _, err) = run(&["run", &scene, "--precision", "half"]);
    assert_eq!(code, Some(2));
    assert!(err.contains("exact") && err.contains("double") && err.contains("float"), "{err}");
}

#[cfg(feature = "wgsl")]
#[test]
fn stats_tell_of_structures_that_a_few_rays_look_through() {
    let structures = |blades: u32, rays: u32| {
        let folder = scene_folder(
            &format!(
                "launch = {rays}\n[geometry.grass]\ntype = 'grass'\ncount = {blades}\narea = [9, 7]\n\
                 [[instance]]\ngeometry = 'grass'\n[pipeline]\nraygen = 'main:look'\n"
            ),
            // From above into the meadow.
            "@ray_generation
             fn look(@builtin(ray_invocation_id) id: vec3u) {
                 let origin = vec3f(f32(id.x) / 256.0, 4.0, 0.0);
                 traceRay(scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.0, 10.0, origin, vec3f(0.0, -1.0, 0.0)), &payload);
             }",
        );
        let scene = folder.path().join("scene.toml").display().to_string();
        let (code, out, err) = run(&["run", &scene, "--stats"]);
        assert_eq!((code, err.as_str()), (Some(0), ""));
        out.lines().find(|line| line.starts_with("structures")).expect("a line").to_owned()
    };
    let line = |trees: &str| {
        format!(
            "structures                1 of 1 were reached by rays and built, {trees} (linear swept spheres)"
        )
    };
    // The first four rays that reach more than 512 primitives look through a list of them.
    let (list, tree) = (line("0 with a tree, 1 as a list for a few rays"), line("1 with a tree"));
    assert_eq!([structures(513, 1), structures(513, 4)], [list.clone(), list]);
    assert_eq!([structures(513, 5), structures(512, 1)], [tree.clone(), tree]);
}

/// Whatever a command with `--json` fails of has one shape, and the class that the exit code tells.
#[test]
fn errors_in_json_have_one_shape() {
    let broken = scratch("class-broken.spv", b"no module");
    let broken = broken.to_str().expect("UTF-8");
    let recording = scratch("class-broken.safetensors", b"no recording");
    let recording = recording.to_str().expect("UTF-8");
    let few: &[&str] = &["inspect", "--json", GRASS, "--limit", "module-bytes=16"];
    for (arguments, code, class) in [
        (&["inspect", "--json", broken][..], 2, "error"),
        (few, 5, "limit"),
        (&["inspect", "--json", GRASS, "--layout", "NoSuchStruct"], 2, "error"),
        (&["smoke", "--json", broken], 2, "error"),
        (&["verify", "--json", recording], 2, "error"),
        (&["verify", "--json", "no/such/folder"], 2, "error"),
        (&["trace-one-ray", "--json", "no/such/scene.toml"], 2, "error"),
    ] {
        let (status, out, err) = run(arguments);
        assert_eq!(status, Some(code), "{arguments:?}: {err}");
        let told: Value = serde_json::from_str(&out).unwrap_or_else(|_| panic!("{arguments:?}: {out}"));
        let errors = told["errors"].as_array().expect("errors");
        let first = &errors[0];
        assert_eq!(first["class"], class, "{arguments:?}");
        let report = first["report"].as_str().expect("a report");
        assert!(err.starts_with(report.lines().next().expect("a line")), "{err}");
        assert!(report.contains(first["message"].as_str().expect("a message")), "{report}");
        assert!(first["notes"].is_array());
    }
}

#[test]
fn what_does_not_run_has_the_class_of_its_error() {
    let path = scratch("class-refused.spv", &refused_module());
    let path = path.to_str().expect("UTF-8");
    let (code, out, _) = run(&["inspect", "--json", path]);
    let report: Value = serde_json::from_str(&out).expect("JSON");
    // To inspect is no failure.
    assert_eq!((code, report.get("errors")), (Some(0), None));
    assert_eq!(report["entry_points"][0]["errors"][0]["class"], "unsupported");
    let (code, out, _) = run(&["smoke", "--json", path]);
    let report: Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!((code, &report["errors"][0]["class"]), (Some(4), &json!("unsupported")));
    assert_eq!(report["entry_points"][0]["errors"][0]["class"], "unsupported");
    let (_, out, _) = run(&["inspect", "--json", GRASS]);
    let report: Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!(report["entry_points"][0]["errors"], json!([]));
}

/// Numbers that a flag cannot mean: none, negative ones, what is no number, ranges without a seed.
#[test]
fn numbers_that_a_flag_cannot_mean_are_refused() {
    const MODULE: &str = "spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";
    const SCENE: &str = "shaders/pass/sphere/closest-hit/scene.toml";
    let float = ["nan", "-nan", "-1", "inf", "1e999", "x", ""];
    let whole = ["0", "-1", "1.5", "nan", "inf", "18446744073709551616", "x", ""];
    let range = ["0..0", "4..4", "5..4", "-1..4", "0..x", "..", "4", "0..18446744073709551616", ""];
    let seconds = ["0", "-0", "-1", "nan", "inf", "1e300", "x", ""];
    for (command, flag, values) in [
        (&["run", MODULE][..], "--many-seeds", &whole[..]),
        (&["run", MODULE], "--seed-range", &range),
        (&["test", "shaders/pass/testing/leaves"], "--many-seeds", &whole),
        (&["test", "shaders/pass/testing/leaves"], "--seed-range", &range),
        (&["render", SCENE], "--many-seeds", &whole),
        (&["trace-one-ray", SCENE], "--seed-range", &range),
        (&["run", MODULE, "--perturb", "2"], "--tolerance", &float),
        (&["run", MODULE], "--perturb", &whole),
        (&["run", MODULE], "--fuel", &whole),
        (&["run", MODULE], "--launch-fuel", &whole),
        (&["run", MODULE], "--timeout", &seconds),
        (&["run", MODULE], "--batch-timeout", &seconds),
        (&["run", MODULE], "--subgroup-size", &whole),
        (&["run", MODULE], "--lanes", &whole),
        (&["test", "shaders/pass/testing/leaves"], "--jobs", &whole),
        (&["test", "shaders/pass/testing/leaves"], "--shard", &["0/2", "3/2", "1/0", "-1/2", "1/x", "1", ""]),
        (&["smoke", MODULE], "--fuel", &whole),
        (&["smoke", MODULE], "--total-fuel", &whole),
        (&["smoke", MODULE], "--seconds", &seconds),
        (&["smoke", MODULE], "--min-coverage", &["-1", "101", "nan", "inf", "x", ""]),
        (&["smoke", MODULE], "--jobs", &whole),
        (&["render", SCENE], "--size", &["0x1", "1x0", "-1x1", "1", "x", "4294967296x1", ""]),
        (&["render", SCENE, "--heat", "nodes"], "--heat-max", &["0", "-1", "nan", "inf", "x", ""]),
        (&["verify", "tests/driver-golden"], "--max-ulp", &float),
        (&["trace-one-ray", SCENE, "--ray", "0,0,5 0,0,-1"], "--t-min", &["nan", "1e39", "x", ""]),
        (&["trace-one-ray", SCENE, "--ray", "0,0,5 0,0,-1"], "--t-max", &["nan", "1e39", "x", ""]),
        (
            &["trace-one-ray", SCENE, "--ray", "0,0,5 0,0,-1"],
            "--time",
            &["-0.5", "1.5", "nan", "inf", "x", ""],
        ),
        (&["trace-one-ray", SCENE], "--depth", &whole),
        (&["trace-one-ray", SCENE], "--at", &["a:0", "a:-1", "a:x", "a", ":1", ""]),
        (&["trace-one-ray", SCENE], "--pixel", &["-1,0", "0", "nan,0", "1.5,0", ""]),
    ] {
        for value in values {
            let given = format!("{flag}={value}");
            let (code, out, err) = run(&[command, &[&given]].concat());
            assert_eq!(code, Some(2), "{command:?} {given}: {out}{err}");
            assert!(err.starts_with("error: ") && err.contains(flag), "{command:?} {given}: {err}");
        }
    }
    #[cfg(feature = "stress")]
    for (command, flag, values) in [
        ("stress", "--cases", &whole[..]),
        ("stress", "--rays", &whole),
        ("stress", "--minutes", &seconds),
        ("stress", "--seed-range", &range),
        ("check-math", "--stride", &whole),
        ("check-math", "--pairs", &whole),
        ("check-math", "--samples", &whole),
    ] {
        for value in values {
            let (code, out, err) = run(&[command, &format!("{flag}={value}")]);
            assert_eq!(code, Some(2), "{command} {flag}={value}: {out}{err}");
        }
    }
    // Ranges of which nothing is asked for.
    for (flags, told) in [
        (["--many-seeds=2", "--seed-range=2..5"], "no seed of `--many-seeds 2`"),
        (["--perturb=2", "--seed-range=2..5"], "no run of `--perturb 2`"),
    ] {
        let (code, out, err) = run(&["run", MODULE, flags[0], flags[1]]);
        assert_eq!((code, err.contains(told)), (Some(2), true), "{out}{err}");
    }
}

/// Standard output has the data alone, whatever else the command prints; files of data are named
/// from the root of the repository.
#[test]
fn findings_as_data_have_standard_output_to_themselves() {
    let folder = suite_of_divisions("data-alone");
    let folder = folder.to_str().expect("UTF-8");
    let [sarif, json] = ["findings.sarif", "findings.json"].map(|name| format!("{folder}/{name}"));
    let results = |text: &str| {
        let sarif: Value = serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"));
        sarif["runs"][0]["results"].as_array().expect("results").len()
    };
    for arguments in [
        &["test", folder, "--sanitize"][..],
        &["test", folder, "--sanitize", "--format", "github"],
        &["test", folder, "--sanitize", "--coverage", &format!("{folder}/a.lcov")],
        &["run", "spirv-fixtures/many-seeds/undefined-drawn/broken.comp.spv", "--sanitize"],
        &["run", "spirv-fixtures/many-seeds/undefined-drawn/broken.comp.spv", "--sanitize", "--stats"],
    ] {
        let (_, out, err) = run(&[arguments, &["--findings", "sarif"]].concat());
        assert!(results(&out) > 0, "{arguments:?}: {out}{err}");
        let (_, out, err) = run(&[arguments, &["--sarif", "-"]].concat());
        assert!(results(&out) > 0, "{arguments:?}: {out}{err}");
        let (_, out, _) = run(&[arguments, &["--sarif", &sarif, "--findings-json", &json]].concat());
        assert!(serde_json::from_str::<Value>(&out).is_err(), "text stays text: {out}");
        assert!(results(&std::fs::read_to_string(&sarif).expect("a file")) > 0);
        let written = std::fs::read_to_string(&json).expect("a file");
        let (_, out, err) = run(&[arguments, &["--findings-json", "-"]].concat());
        assert_eq!(out, written, "{arguments:?}: {err}");
        assert!(serde_json::from_str::<Vec<Value>>(&out).is_ok_and(|all| !all.is_empty()), "{out}");
    }
    let module = "spirv-fixtures/many-seeds/undefined-drawn/broken.comp.spv";
    for modules in [&[module][..], &[module, "spirv-fixtures/pass/sphere/closest-hit/main.rmiss.spv"]] {
        let (_, out, err) = run(&[&["smoke"], modules, &["--sanitize", "--sarif", &sarif]].concat());
        assert!(results(&std::fs::read_to_string(&sarif).expect("a file")) > 0, "{out}{err}");
        let (_, out, err) = run(&[&["smoke"], modules, &["--sanitize", "--sarif", "-"]].concat());
        assert!(results(&out) > 0, "{out}{err}");
        let (_, out, err) = run(&[&["smoke"], modules, &["--sanitize", "--findings-json", "-"]].concat());
        assert!(serde_json::from_str::<Vec<Value>>(&out).is_ok_and(|all| !all.is_empty()), "{out}{err}");
    }
    // Two kinds of data would be none.
    for (arguments, flags) in [
        (&["test", folder, "--junit", "-", "--sarif", "-", "--sanitize"][..], ["--sarif -", "--junit -"]),
        (&["test", folder, "--sarif", "-", "--format", "json"], ["--sarif -", "--format json"]),
        (
            &["run", module, "--sanitize", "--sarif", "-", "--findings", "json"],
            ["--findings json", "--sarif -"],
        ),
        (&["smoke", module, "--sanitize", "--sarif", "-", "--json"], ["--json", "--sarif -"]),
    ] {
        let (code, out, err) = run(arguments);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments:?}: {err}");
        let message = format!("`{}` and `{}` cannot both print to standard output", flags[0], flags[1]);
        assert!(err.contains(&message), "{arguments:?}: {err}");
    }
    let (_, out, err) = run(&["test", folder, "--junit", "-"]);
    assert!(out.starts_with("<?xml") && out.trim_end().ends_with("</testsuites>"), "{out}{err}");
    let (code, _, err) = run(&["test", folder, "--sanitize", "--format", "json", "--findings", "sarif"]);
    assert_eq!((code, err.contains("--sarif FILE")), (Some(2), true), "{err}");
}

/// From a folder below, the path of a scene begins with `..`: what other tools read does not.
#[test]
fn paths_for_other_tools_have_no_dots() {
    let folder = suite_of_divisions("dotted-paths");
    let below = folder.join("below/here");
    std::fs::create_dir_all(&below).expect("a folder");
    let dotted = "../../below/../";
    let output = anyhit(&[
        "test",
        dotted,
        "--sanitize",
        "--format",
        "github",
        "--sarif",
        "a.sarif",
        "--coverage",
        "a.lcov",
    ])
    .current_dir(&below)
    .env_remove("GITHUB_WORKSPACE")
    .output()
    .expect("the command starts");
    let out = String::from_utf8_lossy(&output.stdout);
    let read = |name: &str| {
        std::fs::read_to_string(below.join(name)).unwrap_or_else(|error| panic!("{error}: {out}"))
    };
    let annotations: Vec<&str> = out.lines().filter_map(|line| line.strip_prefix("::error file=")).collect();
    assert!(!annotations.is_empty(), "{out}");
    let sources: Vec<String> =
        read("a.lcov").lines().filter_map(|line| Some(line.strip_prefix("SF:")?.to_owned())).collect();
    let sarif: Value = serde_json::from_str(&read("a.sarif")).expect("SARIF");
    let uris: Vec<&str> = sarif["runs"][0]["results"]
        .as_array()
        .expect("results")
        .iter()
        .filter_map(|result| result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"].as_str())
        .collect();
    let paths = annotations.iter().map(|line| line.split(',').next().unwrap_or_default());
    for path in paths.chain(sources.iter().map(String::as_str)).chain(uris) {
        assert!(!path.split('/').any(|part| part == ".."), "{path}");
    }
}

/// A module where a scene is needed, and a file that no scene could name.
#[test]
fn a_file_of_another_kind_is_named() {
    const MODULE: &str = "spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";
    for command in ["test", "render", "trace-one-ray"] {
        let (code, out, err) = run(&[command, MODULE]);
        let text = format!("{out}{err}");
        assert_eq!(
            (code, text.contains("the file is a SPIR-V module, expected a scene")),
            (Some(2), true),
            "{text}"
        );
        assert!(text.contains("anyhit scene --init MODULE"), "{text}");
    }
    let renamed = scratch(
        "module.toml",
        &std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(MODULE)).expect("a module"),
    );
    let (code, _, err) = run(&["run", renamed.to_str().expect("UTF-8")]);
    assert_eq!((code, err.contains("the file is a SPIR-V module")), (Some(2), true), "{err}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_module_runs_whatever_its_name() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let module = std::fs::read(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/compute/prefix-sum/main.comp.spv"),
    );
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("odd-names");
    std::fs::create_dir_all(&folder).expect("a folder");
    for name in [&b"m\xe9.spv"[..], b"a\nb.spv", b"a\"'\\b.spv"] {
        let path = folder.join(OsStr::from_bytes(name));
        std::fs::write(&path, module.as_ref().expect("a module")).expect("a module");
        let Output { status, stdout, stderr } =
            anyhit(&["run"]).arg(&path).output().expect("the command starts");
        assert_eq!(status.code(), Some(0), "{}", String::from_utf8_lossy(&stderr));
        assert!(String::from_utf8_lossy(&stdout).contains("sums = [0, 1, 3, 6"));
    }
}

/// A shell completes a command, its options and their values.
#[test]
fn shells_complete_commands_and_options() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let (code, script, _) = run(&["completions", shell]);
        assert_eq!(code, Some(0), "{shell}");
        assert!(script.contains("trace-one-ray") && script.contains("many-seeds"), "{shell}");
    }
    assert_eq!(run(&["completions", "cmd"]).0, Some(2));
    if !skipped::has_programs(test_name!(), &["bash"]) {
        return;
    }
    let (_, script, _) = run(&["completions", "bash"]);
    let path = scratch("completions.bash", script.as_bytes());
    for (words, expected) in
        [("trace", "trace-one-ray"), ("test --juni", "--junit"), ("test --format git", "gitlab")]
    {
        let typed = words.split(' ').count();
        let ask = format!(
            ". '{}'; COMP_WORDS=(anyhit {words}); COMP_CWORD={typed}; \
             _anyhit anyhit \"${{COMP_WORDS[$COMP_CWORD]}}\" \"${{COMP_WORDS[$COMP_CWORD-1]}}\"; \
             printf '%s\\n' \"${{COMPREPLY[@]}}\"",
            path.display()
        );
        let output = Command::new("bash").args(["-c", &ask]).output().expect("bash");
        let completed = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(completed.lines().any(|line| line == expected), "{words}: {completed}");
    }
}

/// A page for the program and one for each command, with its options.
#[test]
fn manual_pages_describe_every_command() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("man-pages");
    let _ = std::fs::remove_dir_all(&folder);
    let (code, out, err) = run(&["man", folder.to_str().expect("UTF-8")]);
    assert_eq!((code, out.as_str()), (Some(0), ""), "{err}");
    let read = |name: &str| {
        std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    let commands: Vec<String> =
        anyhit::cli::command().get_subcommands().map(|one| one.get_name().to_owned()).collect();
    assert!(commands.len() > 8);
    for command in commands {
        let page = read(&format!("anyhit-{command}.1"));
        assert!(page.contains(&format!(".TH anyhit-{command} 1")), "{command}: {page:.200}");
    }
    assert!(read("anyhit-test.1").contains("many\\-seeds"));
    assert!(read("anyhit.1").contains(".TH anyhit 1"));
}
