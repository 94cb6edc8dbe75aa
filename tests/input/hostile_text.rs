//! Names, paths and texts with line feeds, escape sequences, workflow commands and markup in every
//! field that a file can set: no output format passes them through.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use crate::support::assembly::assemble;
use crate::support::program::{at, scratch};

/// What is planted: a workflow command on a line of its own, a colour, the title of a window, text
/// from right to left, an invisible letter, a control of C1, markup, and what ends an attribute.
const PLANTED: &str = "\n::error::N\u{1b}[31m\u{1b}]0;t\u{7}\r\u{202e}\u{200b}\u{9b}2J<script>\"'--!>&amp;";
/// What is planted in names of files and folders, which have no `/`.
const PLANTED_FILE: &str = "\n::error::N\u{1b}[31m\u{202e}<script>\"'&amp;";
/// How it begins as an escape.
const SHOWN: &str = r"\u000a::error::N";

/// A place for `PLANTED` in a module: as many bytes.
fn place(number: usize) -> String {
    let mut place = format!("P{number:02}_");
    place.extend(std::iter::repeat_n('p', PLANTED.len() - place.len()));
    place
}

/// A module of a ray generation or compute shader that names everything `PLANTED`: entry point,
/// sources, types, members, variables, functions, extensions. It reads past its buffer where
/// `reaches` is 1000, and prints.
fn module(stage: &str, reaches: u32) -> Vec<u8> {
    let mode = match stage {
        "GLCompute" => "OpExecutionMode %main LocalSize 1 1 1",
        _ => "",
    };
    let ray_tracing = match stage {
        "GLCompute" => String::new(),
        _ => "OpCapability RayTracingKHR\nOpExtension \"SPV_KHR_ray_tracing\"".to_owned(),
    };
    let names: Vec<String> = (0..12).map(place).collect();
    let [entry, file, source, block, member, variable, function, format, local, other, processed, text] =
        &names[..]
    else {
        unreachable!("twelve names")
    };
    let assembled = assemble(&format!(
        "OpCapability Shader
         {ray_tracing}
         OpExtension \"SPV_KHR_non_semantic_info\"
         %printf = OpExtInstImport \"NonSemantic.DebugPrintf\"
         %unknown = OpExtInstImport \"NonSemantic.{other}\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint {stage} %main \"{entry}\"
         {mode}
         %file = OpString \"{file}\"
         %format = OpString \"printed {format} %u\"
         OpSource GLSL 460 %file \"{source}\"
         OpSourceExtension \"{text}\"
         OpName %main \"{function}\"
         OpName %Block \"{block}\"
         OpMemberName %Block 0 \"{member}\"
         OpName %block \"{variable}\"
         OpName %local \"{local}\"
         OpModuleProcessed \"{processed}\"
         OpDecorate %Array ArrayStride 4
         OpDecorate %Block Block
         OpMemberDecorate %Block 0 Offset 0
         OpDecorate %block DescriptorSet 0
         OpDecorate %block Binding 1
         %void = OpTypeVoid
         %function = OpTypeFunction %void
         %uint = OpTypeInt 32 0
         %0 = OpConstant %uint 0
         %1 = OpConstant %uint 1
         %reach = OpConstant %uint {reaches}
         %Array = OpTypeRuntimeArray %uint
         %Block = OpTypeStruct %Array
         %ptr_Block = OpTypePointer StorageBuffer %Block
         %ptr_uint = OpTypePointer StorageBuffer %uint
         %ptr_local = OpTypePointer Function %uint
         %block = OpVariable %ptr_Block StorageBuffer
         %main = OpFunction %void None %function
         %begin = OpLabel
         %local = OpVariable %ptr_local Function
         OpLine %file 2 1
         OpStore %local %reach
         %undefined = OpUndef %uint
         %printed = OpExtInst %void %printf 1 %format %1
         %index = OpLoad %uint %local
         %at = OpAccessChain %ptr_uint %block %0 %index
         OpStore %at %undefined
         OpReturn
         OpFunctionEnd"
    ));
    planted(assembled, &names)
}

/// Replaces the places of a module.
fn planted(mut module: Vec<u8>, places: &[String]) -> Vec<u8> {
    for place in places {
        let mut begin = 0;
        while let Some(found) = find(&module[begin..], place.as_bytes()) {
            begin += found;
            module[begin..begin + place.len()].copy_from_slice(PLANTED.as_bytes());
        }
    }
    module
}

fn find(bytes: &[u8], part: &[u8]) -> Option<usize> {
    bytes.windows(part.len()).position(|window| window == part)
}

/// A string of TOML and of JSON.
fn quoted(text: &str) -> String {
    serde_json::to_string(text).expect("JSON").replace('\u{9b}', "\\u009b")
}

/// Runs the program; its exit code, and both streams as they are.
fn run(folder: &Path, arguments: &[&str], input: &str) -> (Option<i32>, String, String) {
    use std::io::Write;
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).current_dir(folder).env_remove("GITHUB_WORKSPACE");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program");
    // A command that reads no input may have ended.
    let _ = child.stdin.take().expect("its input").write_all(input.as_bytes());
    let output = child.wait_with_output().expect("its output");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// The commands of a log of `anyhit test --format github`.
const OWN: &[&str] = &["::error file=", "::group::", "::endgroup::"];

/// Checks that a text neither steers a terminal nor a workflow; `own` are beginnings of lines that
/// are commands of the program itself.
fn assert_safe(what: &str, text: &str, own: &[&str]) {
    let hidden =
        |c: char| c.is_control() && c != '\n' && c != '\t' || "\u{200b}\u{202e}\u{2066}\u{feff}".contains(c);
    if let Some(found) = text.chars().find(|c| hidden(*c)) {
        panic!("{what}: U+{:04X} in {text}", u32::from(found));
    }
    for line in text.lines() {
        let begin = line.trim_start();
        let is_command = begin.starts_with("::") || begin.starts_with("##[");
        assert!(!is_command || own.iter().any(|one| begin.starts_with(one)), "{what}: `{line}` in {text}");
    }
}

/// A log of GitHub without what is printed while commands are stopped: from the line that stops
/// them to the one with the word that begins them again, which nobody could know before.
fn while_commands_run(log: &str) -> String {
    let (mut kept, mut end) = (String::new(), None);
    for line in log.lines() {
        match (&end, line.strip_prefix("::stop-commands::")) {
            (None, Some(word)) => end = Some(format!("::{word}::")),
            (None, None) => kept += &format!("{line}\n"),
            (Some(word), _) if line == word => end = None,
            (Some(_), _) => {}
        }
    }
    assert_eq!(end, None, "commands go on: {log}");
    kept
}

/// A folder with scenes and modules in which everything is `PLANTED`.
fn project(name: &str) -> PathBuf {
    let folder = scratch(name).canonicalize().expect("a folder");
    std::fs::write(folder.join("good.spv"), module("RayGenerationKHR", 0)).expect("a module");
    std::fs::write(folder.join("bad.spv"), module("RayGenerationKHR", 1000)).expect("a module");
    std::fs::write(folder.join("good.comp.spv"), module("GLCompute", 0)).expect("a module");
    std::fs::write(folder.join("bad.comp.spv"), module("GLCompute", 1000)).expect("a module");
    std::fs::write(folder.join(format!("{PLANTED_FILE}.comp.spv")), module("GLCompute", 1000))
        .expect("a module");
    let model = format!(
        "mtllib a.mtl\no {0}\ng {0}\nusemtl {0}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        PLANTED.replace(['\n', '\r'], " ")
    );
    std::fs::write(folder.join("a.obj"), model).expect("a model");
    std::fs::write(folder.join("a.mtl"), format!("newmtl {}\n", PLANTED.replace(['\n', '\r'], " ")))
        .expect("a model");
    for (case, module) in [("good", "good.spv"), ("bad", "bad.spv"), (PLANTED_FILE, "bad.spv")] {
        let cases = folder.join("cases").join(case);
        std::fs::create_dir_all(&cases).expect("a folder");
        std::fs::write(cases.join("scene.toml"), scene(&format!("../../{module}"))).expect("a scene");
    }
    folder
}

/// A scene whose every name is `PLANTED`.
fn scene(module: &str) -> String {
    let name = quoted(PLANTED);
    format!(
        "version = 1
         launch = [2, 2]
         [shaders.{name}]
         path = {}
         entry = {name}
         [pipeline]
         raygen = {name}
         [resources.{name}]
         type = 'storage_buffer'
         binding = 1
         size = 16
         [geometry.{name}]
         type = 'triangles'
         vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
         [[instance]]
         geometry = {name}
         [[variant]]
         name = {name}
         [[ray]]
         name = {name}
         origin = [0, 0, 1]
         direction = [0, 0, -1]
         expect = {{ t = 5, because = {name} }}
         [expect]
         stdout = {name}
         ",
        quoted(module)
    )
    .lines()
    .map(|line| format!("{}\n", line.trim()))
    .collect()
}

/// Every command that reads a module or a scene, in every format that goes to a stream.
#[test]
fn no_stream_passes_it_through() {
    let folder = project("hostile-streams");
    let planted_module = format!("{PLANTED_FILE}.comp.spv");
    let planted_scene = format!("cases/{PLANTED_FILE}/scene.toml");
    let annotations = [OWN, &["::warning file=", "::error title=", "::warning title="]].concat();
    let mut shown = 0;
    for arguments in [
        &["inspect", "bad.spv"][..],
        &["inspect", "bad.spv", "--json"],
        &["inspect", &planted_module],
        &["inspect", &planted_module, "--json"],
        &["inspect", "--layout", "bad.spv"],
        &["inspect", "bad.spv", "--layout", PLANTED],
        &["inspect", PLANTED],
        &["smoke", "bad.spv", "good.spv", &planted_module],
        &["smoke", "bad.spv", "--sanitize"],
        &["smoke", "bad.spv", "--json", "--sanitize"],
        &["smoke", &planted_module, "bad.spv", "--json"],
        &["run", &planted_module, "--sanitize"],
        &["run", &planted_module, "--sanitize", "--findings", "json"],
        &["run", &planted_module, "--sanitize", "--findings", "sarif"],
        &["run", &planted_module, "--sanitize", "--findings", "github"],
        &["run", &planted_module, "--many-seeds", "2"],
        &["run", &planted_scene, "--sanitize"],
        &["run", &planted_scene, "--sanitize", "--findings", "github"],
        &["run", "cases/good/scene.toml", "--dump", PLANTED],
        &["run", "cases/good/scene.toml", "--dump", "nothing"],
        &["run", "cases/good/scene.toml", "--stats"],
        &["run", "cases/good/scene.toml", "--variant", "nothing"],
        &["run", "good.comp.spv", "--entry", PLANTED],
        &["run", "good.comp.spv", "--entry", "nothing"],
        &["trace-one-ray", "cases/bad/scene.toml", "--pixel", "0,0"],
        &["trace-one-ray", "cases/bad/scene.toml", "--pixel", "0,0", "--json"],
        &["trace-one-ray", "cases/bad/scene.toml", "--ray", "0.2,0.2,1 0,0,-1", "--all"],
        &["trace-one-ray", "cases/bad/scene.toml", "--ray", "nothing"],
        &["trace-one-ray", "cases/bad/scene.toml", "--pixel", "0,0", "--sanitize"],
        &["test", "cases"],
        &["test", "cases", "--list"],
        &["test", "cases", "--filter", PLANTED],
        &["test", "cases", "--sanitize", "--many-seeds", "2"],
        &["test", "cases", "--format", "json", "--sanitize"],
        &["test", "cases", "--format", "github", "--sanitize"],
        &["test", "cases", "--format", "github", "--findings", "github", "--sanitize"],
        &["test", "cases", "--coverage", "coverage.lcov"],
        &["test", PLANTED],
        &["render", "cases/good/scene.toml"],
        &["verify", PLANTED],
        &["merge", PLANTED],
        &["compile", "--help"],
    ] {
        let (code, out, err) = run(&folder, arguments, "");
        let what = format!("{arguments:?}");
        assert!(matches!(code, Some(0..=6)), "{what}: {code:?}\n{out}{err}");
        assert_safe(&what, &while_commands_run(&out), &annotations);
        assert_safe(&what, &err, &[]);
        shown += usize::from(format!("{out}{err}").contains("::error::N"));
    }
    assert!(shown > 30, "only {shown} commands show a planted name");
}

/// A debugger's prompt, its answers and what shaders print there.
#[test]
#[cfg(feature = "debugger")]
fn no_prompt_passes_it_through() {
    let folder = project("hostile-prompt");
    let commands = "list\nlocals\nglobals\nbreak 2\ninfo breakpoints\nnext\nprint \u{1b}[31m\n\u{20ac}\nbacktrace\ncontinue\nhelp\n";
    for command in commands.lines() {
        let script = format!("next\n{command}\n");
        let arguments = ["trace-one-ray", "cases/bad/scene.toml", "--pixel", "0,0", "-i"];
        let (_, out, err) = run(&folder, &arguments, &script);
        assert_safe(command, &out, &[]);
        assert_safe(command, &err, &[]);
    }
    let arguments = ["trace-one-ray", "cases/bad/scene.toml", "--pixel", "0,0", "-i"];
    let (_, out, _) = run(&folder, &arguments, "next\n");
    assert!(out.contains(SHOWN), "{out}");
}

/// Data stays data: JSON and SARIF are read, XML and HTML have no element of the planted text, an
/// lcov tracefile has its records alone.
#[test]
fn no_file_passes_it_through() {
    let folder = project("hostile-files");
    let file = |name: &str| at(&folder, name);
    let (lcov, junit, sarif, result) = (file("a.lcov"), file("a.xml"), file("a.sarif"), file("a.json"));
    let pictures = file("pictures");
    let (code, out, err) = run(
        &folder,
        &[
            "test",
            "cases",
            "--coverage",
            &lcov,
            "--junit",
            &junit,
            "--sarif",
            &sarif,
            "--sanitize",
            "--result",
            &result,
            "--pictures",
            &pictures,
        ],
        "",
    );
    // A shader traps.
    assert_eq!(code, Some(3), "{out}{err}");
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let tracefile = read(&lcov);
    assert_safe("lcov", &tracefile, &[]);
    let records = [
        "TN:",
        "SF:",
        "FN:",
        "FNDA:",
        "FNF:",
        "FNH:",
        "BRDA:",
        "BRF:",
        "BRH:",
        "DA:",
        "LF:",
        "LH:",
        "end_of_record",
    ];
    for line in tracefile.lines() {
        assert!(records.iter().any(|record| line.starts_with(record)), "{line}");
    }
    assert!(tracefile.contains(SHOWN), "{tracefile}");
    let report = read(&junit);
    assert_safe("junit", &report, &[]);
    assert!(!report.contains("<script"), "{report}");
    let suites = junit_parser::from_reader(report.as_bytes()).expect("JUnit XML");
    assert!(suites.tests >= 6 && report.contains(SHOWN), "{report}");
    let findings: Value = serde_json::from_str(&read(&sarif)).expect("SARIF");
    for finding in findings["runs"][0]["results"].as_array().expect("results") {
        let message = finding["message"]["text"].as_str().expect("a message");
        assert_safe("sarif", message, &[]);
        let uri = &finding["locations"][0]["physicalLocation"]["artifactLocation"]["uri"];
        let uri = uri.as_str().unwrap_or_default();
        assert!(!uri.contains(['\n', '<', '"', ' ']) && !uri.contains("/../"), "{uri}");
    }
    for format in ["plain", "github"] {
        let (_, merged, err) = run(&folder, &["merge", &result, "--format", format], "");
        assert_safe("merge", &while_commands_run(&merged), OWN);
        assert_safe("merge", &err, &[]);
    }
    for (arguments, name) in [
        (&["render", "cases/good/scene.toml", "--html", "a.html"][..], "a.html"),
        (&["render", "cases/good/scene.toml", "--profile", "a.folded"], "a.folded"),
        (&["trace-one-ray", "cases/bad/scene.toml", "--ray", "0.2,0.2,1 0,0,-1", "--draw", "a.svg"], "a.svg"),
        (&["trace-one-ray", "cases/bad/scene.toml", "--ray", "0.2,0.2,1 0,0,-1", "--obj", "b.obj"], "b.obj"),
    ] {
        let (code, out, err) = run(&folder, arguments, "");
        assert_safe(name, &out, &[]);
        assert_safe(name, &err, &[]);
        // A scene without a picture has no page.
        let Ok(text) = std::fs::read_to_string(folder.join(name)) else {
            assert!(name == "a.html" && code == Some(2), "{name}: {out}{err}");
            continue;
        };
        // A page is no log: what shaders print begins lines of its own.
        assert_safe(name, &text, if name == "a.html" { &["::error::N"] } else { &[] });
        let is_markup = name.ends_with("html") || name.ends_with("svg");
        assert!(!is_markup || !text.contains("<script>\"'"), "{name}: {text}");
    }
}

/// A result of a share that somebody has written by hand.
#[test]
fn no_merged_result_passes_it_through() {
    let folder = project("hostile-results");
    let result = at(&folder, "result.json");
    let (_, out, err) = run(&folder, &["test", "cases/bad", "--result", &result], "");
    let mut value: Value =
        serde_json::from_slice(&std::fs::read(&result).unwrap_or_else(|_| panic!("{out}{err}")))
            .expect("JSON");
    let test = &mut value["shares"]["1"]["tests"][0];
    for key in ["name", "file", "path", "text", "message"] {
        test[key] = PLANTED.into();
    }
    let path = format!("::add-mask::x\n::error file=a::b{PLANTED}");
    test["problem"] = json!({ "path": path, "line": 1, "report": path });
    test["json"]["pictures"] = json!([PLANTED]);
    std::fs::write(&result, value.to_string()).expect("a result");
    for format in ["plain", "github", "json", "gitlab"] {
        let [junit, sarif, summary] =
            ["merged.xml", "merged.sarif", "merged.md"].map(|name| at(&folder, name));
        let files = ["--junit", &junit, "--sarif", &sarif, "--summary", &summary];
        let (_, out, err) = run(&folder, &[&["merge", &result, "--format", format][..], &files].concat(), "");
        let out = while_commands_run(&out);
        assert_safe(format, &out, OWN);
        assert_safe(format, &err, &[]);
        let read = |path: &str| std::fs::read_to_string(path).expect("a report");
        let xml = read(&junit);
        assert!(!xml.contains("<script") && !xml.contains('\u{1b}'), "{xml}");
        assert_safe("sarif", &read(&sarif), &[]);
        let summary = read(&summary);
        assert_safe("summary", &summary, &[]);
        assert!(!summary.contains(['<', '>', '[']), "{summary}");
    }
}

/// The path of a module that a scene names, with a line feed, as a pull request may have it.
#[test]
fn a_path_with_a_line_feed_is_shown_with_an_escape() {
    let folder = scratch("hostile-path");
    let scene = at(&folder, "scene.toml");
    let text = "version = 1\nlaunch = [1, 1]\n[shaders]\nraygen = \"\\n::error::x.spv\"\n[pipeline]\nraygen = \"raygen\"\n";
    std::fs::write(&scene, text).expect("a scene");
    for arguments in [&["run", &scene][..], &["test", &scene], &["test", &scene, "--format", "github"]] {
        let (code, out, err) = run(&folder, arguments, "");
        assert_eq!(code, Some(2), "{out}{err}");
        assert_safe("path", &out, OWN);
        assert_safe("path", &err, &[]);
        assert!(format!("{out}{err}").contains(r"\u000a::error::x.spv"), "{out}{err}");
    }
}

/// What shows a path is in one file: `Path::display` passes everything through.
#[test]
fn paths_are_shown_by_one_function() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    // A client of the debug adapter gets paths to open, and a hash is of the path itself.
    let allowed =
        ["crates/debugger/src/adapter/sources.rs", "crates/compile/src/external.rs", "src/cli/input.rs"];
    for path in crate::support::files::sources() {
        let name = path.strip_prefix(root).expect("below").to_string_lossy().replace('\\', "/");
        let text = std::fs::read_to_string(&path).expect("a source");
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        let is_test = name.ends_with("tests.rs");
        assert!(
            is_test || allowed.contains(&name.as_str()) || !code.contains(".display()"),
            "{name}: `escape::path` shows a path"
        );
    }
}
