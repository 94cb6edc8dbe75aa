//! Bindings of passes: several resources at one set and binding, of which each pass finds its own.

use std::path::Path;
use std::process::{Command, Output};

use anyhit::{LoadedScene, Result};
use tempfile::TempDir;

/// A shader that copies the first number of a buffer at binding 1.
const OF_BUFFER: &str = "struct A { a: f32, rest: f32 }
    @group(0) @binding(0) var<storage, read_write> o: array<f32, 4>;
    @group(0) @binding(1) var<storage, read> a: A;
    @compute @workgroup_size(1) fn main() { o[0] += a.a; }";
/// A shader that copies a texel of an image there.
const OF_IMAGE: &str = "@group(0) @binding(0) var<storage, read_write> o: array<f32, 4>;
    @group(0) @binding(1) var b: texture_2d<f32>;
    @compute @workgroup_size(1) fn main() { o[1] += textureLoad(b, vec2(0), 0).x; }";
/// A shader that copies a number of a buffer with another block there.
const OF_OTHER: &str = "struct B { other: vec2f }
    @group(0) @binding(0) var<storage, read_write> o: array<f32, 4>;
    @group(0) @binding(1) var<storage, read> b: B;
    @compute @workgroup_size(1) fn main() { o[2] += b.other.y; }";

const OUT: &str = "[resources.out]\ntype = 'storage_buffer'\nbinding = 0\ndata = { f32 = [0, 0, 0, 0] }\n";
const A: &str =
    "[resources.a]\ntype = 'storage_buffer'\nbinding = 1\ndata = { value = { a = 1, rest = 5 } }\n";
const B: &str = "[resources.b]\ntype = 'sampled_image'\nbinding = 1\nsize = [1, 1]\nfill = [2, 0, 0, 1]\n";

fn folder(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = format!(
        "version = 1\n[shaders]\nbuffer = 'buffer.wgsl'\nimage = 'image.wgsl'\nother = 'other.wgsl'\n{scene}"
    );
    let files = [
        ("scene.toml", scene.as_str()),
        ("buffer.wgsl", OF_BUFFER),
        ("image.wgsl", OF_IMAGE),
        ("other.wgsl", OF_OTHER),
    ];
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).expect("a writable folder");
    }
    folder
}

fn out(scene: &str) -> Result<Vec<f32>> {
    let folder = folder(scene);
    LoadedScene::open(folder.path().join("scene.toml"))?.launch()?.read_buffer("out")
}

fn anyhit(folder: &Path, arguments: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_anyhit")).args(arguments).current_dir(folder).output();
    output.expect("the command starts")
}

const PASSES: &str = "[[pass]]\nshader = 'buffer'\n[[pass]]\nshader = 'image'\n";

#[test]
fn each_pass_finds_the_resource_of_the_type_that_it_declares() -> Result<()> {
    let dispatches = PASSES.replace("[[pass]]", "[[dispatch]]");
    for passes in [PASSES, &dispatches] {
        for resources in [format!("{A}{B}"), format!("{B}{A}")] {
            assert_eq!(
                out(&format!("{passes}{OUT}{resources}"))?,
                [1.0, 2.0, 0.0, 0.0],
                "{passes}{resources}"
            );
        }
    }
    Ok(())
}

#[test]
fn a_resource_says_whose_it_is() -> Result<()> {
    // Two buffers: one for a pass by its name, and one for the others.
    let passes = "[[pass]]\nshader = 'buffer'\n[[pass]]\nname = 'second'\nshader = 'other'\n[[pass]]\nshader = 'buffer'\n";
    let own = |passes: &str, data: &str| {
        format!("[resources.c]\ntype = 'storage_buffer'\nbinding = 1\npasses = {passes}\ndata = {data}\n")
    };
    let other = "{ value = { other = [7, 8] } }";
    assert_eq!(out(&format!("{passes}{OUT}{A}{}", own("'second'", other)))?, [2.0, 0.0, 8.0, 0.0]);
    assert_eq!(out(&format!("{passes}{OUT}{}{A}", own("1", other)))?, [2.0, 0.0, 8.0, 0.0]);
    // The third pass has a buffer of its own, too.
    let third = own("[2]", "{ value = { a = 100, rest = 0 } }").replace("resources.c", "resources.d");
    assert_eq!(out(&format!("{passes}{OUT}{A}{third}{}", own("'second'", other)))?, [101.0, 0.0, 8.0, 0.0]);
    // Each of them, without one for all.
    let all = format!("{passes}{OUT}{}{}{third}", own("'second'", other), A.to_owned() + "passes = 0\n");
    assert_eq!(out(&all)?, [101.0, 0.0, 8.0, 0.0]);
    // A pass by itself finds its own, too.
    let folder = folder(&all);
    let scene = LoadedScene::open(folder.path().join("scene.toml"))?;
    assert_eq!(scene.launch_pass("second")?.read_buffer::<f32>("out")?, [0.0, 0.0, 8.0, 0.0]);
    let after = scene.launch()?;
    assert_eq!(after.buffer("c")?["_0"]["other"].vec2(), [7.0, 8.0]);
    assert_eq!(after.buffer("d")?["_0"]["a"].f32(), 100.0);
    Ok(())
}

#[test]
fn what_a_pass_exchanges_is_by_name() -> Result<()> {
    // At binding 1 the second pass finds what is bound for the third one.
    let passes = "[[pass]]\nshader = 'buffer'\n[[pass]]\nshader = 'buffer'\nresources = { a = 'c' }\n[[pass]]\nshader = 'other'\n";
    let own = "[resources.c]\ntype = 'storage_buffer'\nbinding = 1\npasses = 2\ndata = { f32 = [16, 64] }\n";
    assert_eq!(out(&format!("{passes}{OUT}{A}{own}"))?, [17.0, 0.0, 64.0, 0.0]);
    Ok(())
}

#[test]
fn commands_call_each_resource_by_its_name_and_by_what_shaders_declare() {
    let folder = folder(&format!("{PASSES}{OUT}{A}{B}"));
    let told = |arguments: &[&str]| {
        let output = anyhit(folder.path(), arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("UTF-8")
    };
    let text = told(&["run", "scene.toml", "--dump", "a", "--dump", "b", "--dump", "a=json"]);
    for words in [
        "set 0, binding 1 `a`:\n  _0 = { a: 1.0, rest: 5.0 }\n",
        "set 0, binding 1 `b`: image of 1 x 1 x 1",
        "{\"binding\":1,\"name\":\"a\",\"set\":0,\"value\":{\"_0\":{\"a\":1.0",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let text = told(&["trace-one-ray", "scene.toml", "--pass", "1"]);
    assert!(text.contains("`out`") || text.contains("out"), "{text}");
    assert!(!text.contains("4294967295"), "{text}");
    assert!(told(&["run", "scene.toml", "--sanitize", "--many-seeds", "2"]).is_empty());
    assert!(!told(&["run", "scene.toml", "--stats"]).contains("4294967295"));
    assert!(!told(&["run", "scene.toml", "--perturb", "2"]).contains("4294967295"));
}

#[test]
fn a_trap_lists_what_its_pass_finds() {
    let beyond = OF_OTHER.replace("other: vec2f", "other: array<vec2f>").replace("b.other", "b.other[9]");
    let passes = "[[pass]]\nshader = 'buffer'\n[[pass]]\nshader = 'other'\n";
    let own = "[resources.c]\ntype = 'storage_buffer'\nbinding = 1\npasses = 1\ndata = { f32 = [7, 8] }\n";
    let folder = folder(&format!("{passes}{OUT}{A}{own}"));
    std::fs::write(folder.path().join("other.wgsl"), beyond).expect("a writable folder");
    let output = anyhit(folder.path(), &["run", "scene.toml"]);
    let text = String::from_utf8(output.stderr).expect("UTF-8");
    assert!(output.status.code() == Some(3) && text.contains("set 0, binding 1"), "{text}");
    assert!(!text.contains("4294967295"), "{text}");
}

#[test]
fn mistakes_are_told() {
    let c = |keys: &str| format!("[resources.c]\ntype = 'storage_buffer'\nbinding = 1\nsize = 8\n{keys}");
    for (scene, words) in [
        (format!("{PASSES}{OUT}{A}{}", c("")), "two resources at set 0, binding 1"),
        (format!("{PASSES}{OUT}{A}{}", c("passes = 'none'\n")), "the scene has no pass `none`"),
        (format!("{PASSES}{OUT}{A}{B}{}", c("passes = 7\n")), "passes: 0, 1"),
        (format!("{PASSES}{OUT}{A}{}", c("pipelines = 'ao'\n")), "no pipeline is named `ao`"),
        (
            format!("{PASSES}{OUT}{}{}", c("passes = [0, 1]\n"), A.to_owned() + "passes = 0\n"),
            "two resources at set 0, binding 1 of pass 0",
        ),
        // The second pass declares an image.
        (
            format!("{PASSES}{OUT}{A}{B}{}", c("passes = 1\n")),
            "declares `b` (set 0, binding 1) as `sampled_image`",
        ),
        // No shader declares an image there.
        (format!("[[pass]]\nshader = 'buffer'\n{OUT}{A}{B}"), "no pass uses this one"),
        (
            format!("{PASSES}{OUT}{A}{B}[resources.e]\ntype = 'buffer'\nsize = 4\npasses = 0\n"),
            "a `buffer` is not bound to a descriptor and has no `passes`",
        ),
    ] {
        let error = out(&scene).expect_err(&scene).render();
        assert!(error.contains(words), "{words}: {error}");
    }
}

#[test]
fn a_pipeline_has_bindings_of_its_own() -> Result<()> {
    let folder = tempfile::tempdir().expect("a folder");
    let launched = |store: &str, declared: &str| {
        format!(
            "enable wgpu_ray_tracing_pipeline;
            @group(0) @binding(0) var<storage, read_write> o: array<f32, 4>;
            @group(0) @binding(1) {declared}
            @ray_generation fn main() {{ {store} }}"
        )
    };
    let files = [
        ("buffer.wgsl", launched("o[0] = a[0];", "var<storage, read> a: array<f32, 2>;")),
        ("other.wgsl", launched("o[1] = a[1];", "var<storage, read> a: array<f32, 2>;")),
        ("image.wgsl", launched("o[2] = textureLoad(b, vec2(0), 0).x;", "var b: texture_2d<f32>;")),
    ];
    for (name, text) in &files {
        std::fs::write(folder.path().join(name), text).expect("a writable folder");
    }
    let scene = "version = 1\n[shaders]\nbuffer = 'buffer.wgsl'\nimage = 'image.wgsl'\nother = 'other.wgsl'\n\
        [pipeline]\nraygen = 'buffer'\n[pipelines.other]\nraygen = 'other'\n[pipelines.image]\nraygen = 'image'\n\
        [[pass]]\n[[pass]]\npipeline = 'other'\n[[pass]]\npipeline = 'image'\n";
    let second =
        "[resources.c]\ntype = 'storage_buffer'\nbinding = 1\npipelines = 'other'\ndata = { f32 = [5, 6] }\n";
    let first = "[resources.a]\ntype = 'storage_buffer'\nbinding = 1\ndata = { f32 = [1, 3] }\n";
    let path = folder.path().join("scene.toml");
    let scene = LoadedScene::from_text(path, &format!("{scene}{OUT}{first}{B}{second}"))?;
    assert_eq!(scene.launch()?.read_buffer::<f32>("out")?, [1.0, 6.0, 2.0, 0.0]);
    Ok(())
}
