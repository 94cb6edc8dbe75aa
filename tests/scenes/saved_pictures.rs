//! Pictures as `run --save`, `render`, shares and `test --bless` write them: encoded as `output`
//! says, and opaque unless alpha is asked for.

use std::path::Path;
use std::process::Command;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;
use tempfile::TempDir;

/// 0.2 in 8 bits, and encoded as sRGB: 1.055 * 0.2^(1 / 2.4) - 0.055 = 0.48453, times 255 = 123.55.
const AS_IS: u8 = 51;
const LINEAR: u8 = 124;
/// A quarter in 8 bits: 63.75.
const QUARTER: u8 = 64;

const SHADER: &str = "@group(0) @binding(0) var o: texture_storage_2d<rgba32float, write>;
    @compute @workgroup_size(1)
    fn main(@builtin(global_invocation_id) id: vec3u) { textureStore(o, id.xy, vec4(0.2, 0.2, 0.2, 0.25)); }";

/// A scene of one dispatch whose image has these keys.
fn scene(keys: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = format!(
        "version = 1\nlaunch = [2, 2]\n[shaders]\na = 'a.wgsl'\n[[dispatch]]\nshader = 'a'\ngroups = [2, 2]\n\
         [resources.o]\ntype = 'storage_image'\nbinding = 0\n{keys}"
    );
    for (name, text) in [("scene.toml", scene.as_str()), ("a.wgsl", SHADER)] {
        std::fs::write(folder.path().join(name), text).expect("a writable folder");
    }
    folder
}

#[track_caller]
fn anyhit(folder: &Path, arguments: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_anyhit")).args(arguments).current_dir(folder).output();
    let output = output.expect("the command starts");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// The pixel at the origin of a picture that a command writes to `out.png`.
#[track_caller]
fn pixel(folder: &Path, arguments: &[&str]) -> [u8; 4] {
    anyhit(folder, arguments);
    image::open(folder.join("out.png")).expect("a PNG").to_rgba8().get_pixel(0, 0).0
}

#[test]
fn a_picture_is_encoded_as_its_image_says_and_opaque() {
    for (keys, gray, alpha) in [
        ("", AS_IS, 255),
        ("output = true", AS_IS, 255),
        ("output = false", AS_IS, 255),
        ("output = 'as_is'", AS_IS, 255),
        ("output = 'linear'", LINEAR, 255),
        ("output = 'linear'\nalpha = true", LINEAR, QUARTER),
        ("output = 'linear'\nformat = 'rgba16f'", LINEAR, 255),
        ("output = 'linear'\nformat = 'rgba16'\nalpha = true", LINEAR, QUARTER),
        // 51 / 255 is 0.2.
        ("output = 'linear'\nformat = 'rgba8'", LINEAR, 255),
        ("alpha = true\nformat = 'rgba8'", AS_IS, QUARTER),
        // What is stored as sRGB stays so.
        ("output = true\nformat = 'rgba8_srgb'", LINEAR, 255),
        ("output = 'linear'\nformat = 'rgba8_srgb'\nalpha = true", LINEAR, QUARTER),
    ] {
        let folder = scene(keys);
        let folder = folder.path();
        for command in
            [&["run", "scene.toml", "--save", "o=out.png"][..], &["render", "scene.toml", "-o", "out.png"]]
        {
            assert_eq!(pixel(folder, command), [gray, gray, gray, alpha], "{keys}: {command:?}");
            let kept = [command, &["--alpha"]].concat();
            assert_eq!(pixel(folder, &kept), [gray, gray, gray, QUARTER], "{keys}: {kept:?}");
        }
        assert_eq!(
            pixel(folder, &["run", "scene.toml", "--save", "0=out.png"]),
            [gray, gray, gray, alpha],
            "{keys}"
        );
        // An empty file beside the scene is one to be filled.
        std::fs::write(folder.join("expect.png"), "").expect("a file");
        anyhit(folder, &["test", ".", "--bless"]);
        let blessed = image::open(folder.join("expect.png")).expect("a PNG").to_rgba8().get_pixel(0, 0).0;
        assert_eq!(blessed, [gray, gray, gray, alpha], "{keys}");
        anyhit(folder, &["test", "."]);
    }
}

#[test]
fn a_view_of_the_image_says_how_it_is_saved() {
    let view = "format = 'rgba32f'\n[resources.shown]\ntype = 'storage_image'\nbinding = 1\nimage = 'o'\n\
                output = 'linear'\nalpha = true";
    let folder = scene(view);
    for command in [
        &["run", "scene.toml", "--save", "o=out.png"][..],
        &["run", "scene.toml", "--save", "shown=out.png"],
        &["render", "scene.toml", "-o", "out.png"],
    ] {
        assert_eq!(pixel(folder.path(), command), [LINEAR, LINEAR, LINEAR, QUARTER], "{command:?}");
    }
}

/// JSON has no numbers for them (RFC 8259, section 6).
#[test]
fn nan_and_infinity_are_strings_in_json() {
    let more = "[resources.n]\ntype = 'storage_image'\nbinding = 1\nformat = 'rg32f'\nsize = [1, 1]\nfill = [nan, -inf]";
    let folder = scene(more);
    let output = Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .args(["run", "scene.toml", "--dump", "n=json"])
        .current_dir(folder.path())
        .output()
        .expect("the command starts");
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(found["value"], serde_json::json!([["NaN", "-inf", 0.0, 1.0]]));
}

/// 2^53 + 1 is no f64.
#[test]
fn integers_of_64_bits_are_printed_exactly() {
    let image = |name: &str, binding: u32, format: &str, data: &str| {
        format!(
            "[resources.{name}]\ntype = 'storage_image'\nbinding = {binding}\nformat = '{format}'\n\
             size = [1, 1]\ndata = {{ {data} }}\n"
        )
    };
    let more = image("u", 1, "r64ui", "u64 = [9007199254740993]")
        + &image("s", 2, "r64i", "i64 = [-9007199254740993]");
    let folder = scene(&more);
    let output = Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .args(["run", "scene.toml", "--dump", "u=json", "--dump", "s=json", "--dump", "u"])
        .current_dir(folder.path())
        .output()
        .expect("the command starts");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let value = |line: &str| serde_json::from_str::<Value>(line).expect("JSON")["value"].clone();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(value(lines[0]), serde_json::json!([[9_007_199_254_740_993_u64, 0, 0, 1]]), "{text}");
    assert_eq!(value(lines[1]), serde_json::json!([[-9_007_199_254_740_993_i64, 0, 0, 1]]), "{text}");
    assert!(text.ends_with("9007199254740993 0 0 1\n"), "{text}");
}

#[test]
fn numbers_and_bytes_are_those_of_the_image() {
    let folder = scene("output = 'linear'");
    let texel = [0.2_f32, 0.2, 0.2, 0.25];
    for command in [
        &["run", "scene.toml", "--save", "o=out.raw"][..],
        &["render", "scene.toml", "-o", "out.raw"],
        &["run", "scene.toml", "--dump", "o=out.raw"],
    ] {
        anyhit(folder.path(), command);
        let bytes = std::fs::read(folder.path().join("out.raw")).expect("a file");
        assert_eq!(bytes, texel.map(f32::to_le_bytes).as_flattened().repeat(4), "{command:?}");
    }
    if cfg!(feature = "exr") {
        for command in
            [&["run", "scene.toml", "--save", "o=out.exr"][..], &["render", "scene.toml", "-o", "out.exr"]]
        {
            anyhit(folder.path(), command);
            let picture = image::open(folder.path().join("out.exr")).expect("an EXR").to_rgba32f();
            assert_eq!(picture.get_pixel(0, 0).0, texel, "{command:?}");
        }
    }
}

/// A launch that stores a texel, and what else a scene says and runs.
fn launched(keys: &str, more: &str, compute: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = format!(
        "version = 1\nlaunch = [2, 2]\n[shaders]\nlaunched = 'launched.wgsl'\ntwice = 'twice.wgsl'\n[pipeline]\n\
         raygen = 'launched'\n{more}[resources.o]\ntype = 'storage_image'\nbinding = 0\n{keys}"
    );
    let launched = "enable wgpu_ray_tracing_pipeline;
        @group(0) @binding(0) var o: texture_storage_2d<rgba32float, write>;
        @ray_generation
        fn main(@builtin(ray_invocation_id) id: vec3u) { textureStore(o, id.xy, vec4(0.1, 0.2, 0.2, 0.25)); }";
    let twice = format!(
        "@group(0) @binding(0) var o: texture_storage_2d<rgba32float, read_write>;
        @compute @workgroup_size(1)
        fn main(@builtin(global_invocation_id) id: vec3u) {{ {compute} }}"
    );
    for (name, text) in [("scene.toml", scene.as_str()), ("launched.wgsl", launched), ("twice.wgsl", &twice)]
    {
        std::fs::write(folder.path().join(name), text).expect("a writable folder");
    }
    folder
}

#[test]
fn a_render_is_what_the_dispatches_leave() {
    let twice = "let texel = textureLoad(o, id.xy); textureStore(o, id.xy, vec4(2.0 * texel.x, texel.yzw));";
    let folder = launched("output = 'linear'", "[[dispatch]]\nshader = 'twice'\ngroups = [2, 2]\n", twice);
    for command in
        [&["render", "scene.toml", "-o", "out.png"][..], &["run", "scene.toml", "--save", "o=out.png"]]
    {
        assert_eq!(pixel(folder.path(), command), [LINEAR, LINEAR, LINEAR, 255], "{command:?}");
    }
}

#[test]
fn pages_and_shares_have_the_same_picture() {
    // 0.1 in 8 bits, 25.5, is rounded to even.
    for (flags, alpha) in [(&[][..], 255), (&["--alpha"], QUARTER)] {
        let folder = launched("output = true", "", "");
        let folder = folder.path();
        let wanted = [26, AS_IS, AS_IS, alpha];
        assert_eq!(pixel(folder, &[&["render", "scene.toml", "-o", "out.png"], flags].concat()), wanted);
        // The page's first picture is the one that would be saved.
        anyhit(
            folder,
            &[&["render", "scene.toml", "--html", "page.html", "-o", "beside.png"], flags].concat(),
        );
        let beside = image::open(folder.join("beside.png")).expect("a PNG").to_rgba8();
        assert_eq!(beside.get_pixel(0, 0).0, wanted);
        let page = std::fs::read_to_string(folder.join("page.html")).expect("a page");
        let (_, data) = page.split_once("<script type=\"application/json\" id=\"data\">").expect("the data");
        let data: Value =
            serde_json::from_str(data.split_once("</script>").expect("its end").0).expect("JSON");
        let shown = data["pictures"][0]["png"].as_str().expect("an address");
        let shown = shown.strip_prefix("data:image/png;base64,").expect("a PNG");
        let bytes = STANDARD.decode(shown).expect("Base64");
        assert_eq!(image::load_from_memory(&bytes).expect("a PNG").to_rgba8().get_pixel(0, 0).0, wanted);
        anyhit(folder, &[&["render", "scene.toml", "--result", "1.json"], flags].concat());
        assert_eq!(pixel(folder, &["merge", "1.json", "-o", "out.png"]), wanted);
    }
}
