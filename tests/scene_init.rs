//! `anyhit scene --init`: pointers lead to buffers, and records are those that rays ask for.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("scene-init").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a writable folder");
    folder
}

/// Runs the command in a folder; returns its exit code and what it printed.
fn anyhit(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    let output = command.args(arguments).current_dir(folder).stdin(Stdio::null()).output();
    let output = output.expect("the command starts");
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8")).concat();
    (output.status.code(), text)
}

/// Writes a scene of fixtures; returns it with what was printed.
fn written(folder: &Path, modules: &[&str]) -> (String, String) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures");
    let modules: Vec<String> = modules.iter().map(|name| root.join(name).display().to_string()).collect();
    let mut arguments = vec!["scene", "--init"];
    arguments.extend(modules.iter().map(String::as_str));
    let (code, text) = anyhit(folder, &arguments);
    assert_eq!(code, Some(0), "{text}");
    (std::fs::read_to_string(folder.join("scene.toml")).expect("the scene"), text)
}

#[track_caller]
fn holds(scene: &str, all: &[&str]) {
    for words in all {
        assert!(scene.contains(words), "no `{words}` in\n{scene}");
    }
}

#[test]
fn pointers_lead_to_buffers_and_circles_are_closed() {
    let folder = scratch("slang");
    let (scene, text) = written(&folder, &["pass/addresses/nested/nested.slang.spv"]);
    assert!(text.contains("run it: anyhit run scene.toml"), "{text}");
    holds(
        &scene,
        &[
            "# The push constants:\n#    0  pointer to",
            "push_constants = { shader = \"shaders\", value = { sceneInfo = { address_of = \"sceneInfo\" } }, \
             rest = \"zeros\" }",
            "record = { shader = \"shaders\", value = { material = { address_of = \"material\" } }, rest = \"zeros\" }",
            // A scene points to itself, and a material to the next one: circles of one.
            "value = { instances = { address_of = \"instances\" }, self = { address_of = \"sceneInfo\" } }",
            "value = { material = { address_of = \"material\" } }, rest = \"zeros\", repeat = 16 }",
            "value = { next = { address_of = \"material\" } }, rest = \"zeros\", repeat = 16 }",
            "[resources.material]\n#    0  vec3 colour\n#   12  float roughness",
            "# Rays are traced with SBT offset 0, SBT stride 0, miss index 0.",
        ],
    );
    assert_eq!(scene.matches("type = \"buffer\"").count(), 3, "{scene}");
    let (code, text) = anyhit(&folder, &["run", "scene.toml", "--dump", "material=hex"]);
    assert_eq!(code, Some(0), "{text}");
    // 16 materials of 32 bytes.
    assert!(text.contains("512 bytes"), "{text}");
}

#[test]
fn blocks_of_several_modules_share_their_buffers() {
    let folder = scratch("glsl");
    let modules = ["main.rgen", "main.rchit", "main.rmiss"];
    let modules = modules.map(|name| format!("pass/addresses/nested-glsl/{name}.spv"));
    let (scene, text) = written(&folder, &modules.each_ref().map(String::as_str));
    assert!(!text.contains("does not run yet"), "{text}\n{scene}");
    assert_eq!(scene.matches("type = \"buffer\"").count(), 3, "{scene}");
    // The block behind `instances` ends in an array of structs.
    holds(
        &scene,
        &["[resources.instances]", "value = { items = [{ material = { address_of = \"material\" } }, "],
    );
}

#[test]
fn records_are_those_that_rays_ask_for() {
    // The shadow ray has miss index 1 and no hit group of its own.
    let (scene, _) = written(&scratch("shadow"), &["demo/swept-spheres/swept_spheres.slang.spv"]);
    holds(&scene, &["SBT offset 0, SBT stride 0, miss index 0 and 1."]);
    // Offset 1 needs a record behind that of offset 0, and miss index 1 a second miss record.
    let (scene, _) = written(&scratch("offset"), &["pass/hit-object/slang/main.slang.spv"]);
    holds(&scene, &["# Rays are traced with SBT offset 1, SBT stride 1, miss index 1."]);
    // What a buffer or a push constant says is not known.
    let modules = ["main.rgen", "main.rchit", "main.rmiss"];
    let modules = modules.map(|name| format!("pass/resources/record-and-push-constants/{name}.spv"));
    let (scene, _) = written(&scratch("unknown"), &modules.each_ref().map(String::as_str));
    holds(&scene, &["SBT offset and miss index of rays in `raygen` are no constants", "SBT stride 1"]);
}

#[cfg(unix)]
#[test]
fn a_printed_command_runs_in_a_shell() {
    let folder = scratch("it's a \"folder\", $HOME");
    let module =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/addresses/nested/nested.slang.spv");
    let path = folder.join("a scene.toml").display().to_string();
    let (code, text) = anyhit(&folder, &["scene", "--init", &module.display().to_string(), "-o", &path]);
    assert_eq!(code, Some(0), "{text}");
    let line = text.split_once("run it: ").expect("a command").1;
    let program = Path::new(env!("CARGO_BIN_EXE_anyhit")).parent().expect("a folder");
    let output = Command::new("/bin/sh").args(["-c", line]).env("PATH", program).current_dir("/").output();
    let output = output.expect("a shell");
    assert!(output.status.success(), "{line}{}", String::from_utf8_lossy(&output.stderr));
}
