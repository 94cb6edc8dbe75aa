//! Bytes that a scene gives for records, push constants and buffers, beside those that shaders
//! declare.

use std::path::Path;

use crate::support::program::{anyhit, at, scratch};

/// The scene with a hit record of 28 bytes and push constants of 60, changed; its modules are those
/// of the repository.
fn scene(name: &str, changes: &[(&str, &str)]) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let file = root.join("shaders/pass/resources/record-and-push-constants/scene.toml");
    let mut text = std::fs::read_to_string(file).expect("a scene").replace("\r\n", "\n");
    let folder = root.to_str().expect("UTF-8").replace('\\', "/");
    text = text.replace("../../../..", &folder);
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let folder = scratch(&format!("given-sizes-{name}"));
    let path = at(&folder, "scene.toml");
    std::fs::write(&path, text).expect("a writable folder");
    path
}

#[test]
fn what_fits_is_not_mentioned() {
    let ran = anyhit(&["run", &scene("fits", &[]), "--dump", "outputs"]);
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
}

/// The structs of the shaders have, by std430: a hit record vec4, uint, float[2]: 28 bytes; push
/// constants up to float[3] at 48: 60 bytes; a ray generation record vec3, float: 16 bytes.
#[test]
fn too_few_bytes_are_a_note() {
    let short_push = &[("    { f32 = [1, 10, 4] },                       # values\n", "")][..];
    let short_hit = &[("{ u32 = 22 }, { f32 = [7, 8] }", "{ u32 = 22 }")][..];
    let short_raygen = &[("record = { f32 = [0, -1, 3, 50] }", "record = { f32 = [0, -1, 3] }")][..];
    for (name, changes, note) in [
        (
            "push",
            short_push,
            "note: the push constants: 48 bytes given, 60 declared by RayGenerationKHR `main`",
        ),
        ("hit", short_hit, "note: hit record 2: 20 bytes given, 28 declared by ClosestHitKHR `main`"),
        (
            "raygen",
            short_raygen,
            "note: the ray generation record: 12 bytes given, 16 declared by RayGenerationKHR",
        ),
    ] {
        let ran = anyhit(&["run", &scene(name, changes), "--dump", "outputs"]);
        assert!(ran.err.contains(note), "{name}: {}", ran.err);
    }
    let ran = anyhit(&[
        "run",
        "spirv-fixtures/pass/compute/print/main.comp.spv",
        "--push",
        "u8 = 1",
        "--dump",
        "1",
    ]);
    assert!(ran.err.contains("the push constants: 1 bytes given, "), "{}", ran.err);
}

/// A record that was packed by other rules than the shader's struct: its values explain a failure.
#[test]
fn a_failure_shows_the_blocks_that_the_shader_reads() {
    let padded = [("{ u32 = 11 }, { f32 = [5, 6] }", "{ u32 = [11, 0, 0, 0] }, { f32 = [5, 6] }")];
    let text = scene("explained", &padded);
    let ran = anyhit(&["trace-one-ray", &text, "--pixel", "0,0"]);
    for part in ["record table[0], byte 20", "record size", "40 bytes given, 28 declared"] {
        assert!(ran.out.contains(part), "`{part}` is missing in {}{}", ran.out, ran.err);
    }
    // What fits has a value and no sizes.
    let ran = anyhit(&["trace-one-ray", &scene("fitting", &[]), "--pixel", "0,0"]);
    assert!(ran.out.contains("record table[1], byte 24") && !ran.out.contains("bytes given"), "{}", ran.out);
}

/// Push constants are shown with what is given and declared.
#[test]
fn an_explanation_shows_push_constants_with_their_sizes() {
    let longer =
        [("    { f32 = [1, 10, 4] },                       # values\n", "    { f32 = [1, 10, 4, 9] },\n")];
    let ran = anyhit(&["trace-one-ray", &scene("longer", &longer), "--pixel", "0,0"]);
    for part in
        ["push constants.scale", "vec2(0.5, 0.25)", "push constants size", "64 bytes given, 60 declared"]
    {
        assert!(ran.out.contains(part), "`{part}` is missing in {}{}", ran.out, ran.err);
    }
}

#[test]
fn a_launch_without_a_size_is_a_note() {
    let note = "no `launch`: one invocation runs; set the size with `launch = [WIDTH, HEIGHT]`";
    let ran = anyhit(&["run", &scene("no-launch", &[("launch = 4\n", "")]), "--dump", "outputs"]);
    assert!(ran.code == Some(0) && ran.err.starts_with("note: ") && ran.err.contains(note), "{}", ran.err);
    let pass =
        [("launch = 4\n", ""), ("[[pipeline.raygen]]", "[[pass]]\nraygen = \"raygen\"\n[[pipeline.raygen]]")];
    let ran = anyhit(&["run", &scene("no-launch-of-pass", &pass), "--dump", "outputs"]);
    assert!(ran.err.contains("no `launch` of pass 0: one invocation runs"), "{}", ran.err);
}
