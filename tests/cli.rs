//! The command line from outside: exit codes, what is printed where, pipes.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use pretty_assertions::assert_eq;
use serde_json::{Value, json};

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
    let module = derivative_module();
    let path = scratch("derivatives.spv", &module);
    let (code, out, _) = run(&["inspect", "--json", path.to_str().expect("UTF-8")]);
    assert_eq!(code, Some(0), "what is not supported is a finding, not an error");
    let report: Value = serde_json::from_str(&out).expect("JSON");
    let entry = &report["entry_points"][0];
    assert_eq!((&entry["name"], &entry["stage"]), (&json!("hit"), &json!("ClosestHitKHR")));
    assert_eq!(entry["supported"], false);
    assert_eq!(
        entry["reasons"],
        json!([
            "the builtin DeviceIndex is not supported (at word 39)",
            "OpDPdx is not supported (2 times, first at word 54)",
        ])
    );
}

#[test]
fn source_text_is_answered_with_the_command_that_compiles_it() {
    let source = "shaders/demo/swept-spheres/grass.rchit";
    let (code, out, err) = run(&["inspect", source]);
    assert_eq!((code, out.as_str()), (Some(2), ""));
    assert!(err.contains(&format!("anyhit compile {source}")), "{err}");
}

#[test]
fn garbled_modules_are_refused_with_a_place() {
    let path = scratch("cut.spv", &derivative_module()[..100]);
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

/// A closest-hit shader that reads `DeviceIndex` and takes two derivatives.
fn derivative_module() -> Vec<u8> {
    let mut words = vec![0x0723_0203, 0x0001_0600, 0, 100, 0];
    let mut op = |opcode: u32, operands: &[u32]| {
        words.push((operands.len() as u32 + 1) << 16 | opcode);
        words.extend(operands);
    };
    op(17, &[4479]); // OpCapability RayTracingKHR
    op(14, &[0, 1]); // OpMemoryModel Logical GLSL450
    op(15, &[5316, 30, u32::from_le_bytes(*b"hit\0"), 20]); // OpEntryPoint ClosestHitKHR
    op(71, &[20, 11, 4438]); // OpDecorate %20 BuiltIn DeviceIndex
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
    op(207, &[6, 33, 7]); // OpDPdx
    op(207, &[6, 34, 7]); // OpDPdx
    op(253, &[]); // OpReturn
    op(56, &[]); // OpFunctionEnd
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}
