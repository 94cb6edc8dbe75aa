//! Dispatches and launches whose size lies in a buffer.

use anyhit::{ErrorKind, LoadedScene, Result};
use tempfile::TempDir;

/// Writes the size of what comes, and counts invocations.
const SHADERS: &str = "struct Sizes { words: array<u32, 8> }
    @group(0) @binding(0) var<storage, read_write> sizes: Sizes;
    @group(0) @binding(1) var<storage, read_write> count: array<atomic<u32>, 4>;
    @compute @workgroup_size(1)
    fn decide() { sizes.words[1] = 3u; sizes.words[2] = 2u; sizes.words[3] = 1u; }
    @compute @workgroup_size(4)
    fn counted(@builtin(num_workgroups) groups: vec3u) {
        atomicAdd(&count[0], 1u);
        atomicMax(&count[1], groups.x); atomicMax(&count[2], groups.y); atomicMax(&count[3], groups.z);
    }";
const LAUNCHED: &str = "enable wgpu_ray_tracing_pipeline;
    @group(0) @binding(1) var<storage, read_write> count: array<atomic<u32>, 4>;
    @ray_generation
    fn launched(@builtin(ray_invocation_id) id: vec3u, @builtin(num_ray_invocations) size: vec3u) {
        atomicAdd(&count[0], 1u);
        atomicMax(&count[1], size.x); atomicMax(&count[2], size.y); atomicMax(&count[3], size.z);
    }";

fn scene(runs: &str, words: &str) -> (TempDir, Result<LoadedScene>) {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in [("main.wgsl", SHADERS), ("launched.wgsl", LAUNCHED)] {
        std::fs::write(folder.path().join(name), text).expect("a writable folder");
    }
    let text = format!(
        "version = 1\n[shaders]\nmain = 'main.wgsl'\nlaunched = 'launched.wgsl'\n[pipeline]\nraygen = 'launched:launched'\n\
         [resources.sizes]\ntype = 'storage_buffer'\nbinding = 0\ndata = {{ u32 = {words} }}\n\
         [resources.count]\ntype = 'storage_buffer'\nbinding = 1\ndata = {{ zeros = 16 }}\n\
         [resources.apart]\ntype = 'buffer'\ndata = {{ u32 = [9, 1, 2, 2] }}\n\
         [resources.view]\ntype = 'storage_buffer'\nbinding = 7\nbuffer = 'sizes'\noffset = 4\n{runs}"
    );
    let scene = LoadedScene::from_text(folder.path().join("scene.toml"), &text);
    (folder, scene)
}

fn counted(runs: &str, words: &str) -> Result<Vec<u32>> {
    let (_folder, scene) = scene(runs, words);
    scene?.launch()?.read_buffer("count")
}

const ZEROS: &str = "[0, 0, 0, 0, 0, 0, 0, 0]";

fn dispatch(groups: &str) -> String {
    format!("[[pass]]\nshader = 'main:counted'\ngroups = {groups}\n")
}

#[test]
fn groups_are_read_when_the_dispatch_runs() -> Result<()> {
    let decide = "[[pass]]\nshader = 'main:decide'\n";
    let own = dispatch("{ buffer = 'sizes', offset = 4 }");
    assert_eq!(counted(&format!("{decide}{own}"), ZEROS)?, [24, 3, 2, 1]);
    // Before it is decided there is nothing.
    assert_eq!(counted(&format!("{own}{decide}"), ZEROS)?, [0; 4]);
    assert_eq!(counted(&own, "[7, 2, 1, 5, 0, 0, 0, 0]")?, [40, 2, 1, 5]);
    // A view's offset counts from its beginning.
    assert_eq!(counted(&dispatch("{ buffer = 'view' }"), "[7, 2, 1, 5, 0, 0, 0, 0]")?, [40, 2, 1, 5]);
    assert_eq!(counted(&dispatch("{ buffer = 'apart', offset = 4 }"), ZEROS)?, [16, 1, 2, 2]);
    // `[[dispatch]]` has the same key; a launch comes first.
    let listed = format!("{decide}{own}").replace("[[pass]]", "[[dispatch]]");
    assert_eq!(counted(&listed, ZEROS)?, [25, 3, 2, 1]);
    Ok(())
}

#[test]
fn launches_are_read_when_they_run() -> Result<()> {
    let decide = "[[pass]]\nshader = 'main:decide'\n";
    let launch = "[[pass]]\nlaunch = { buffer = 'sizes', offset = 4 }\n";
    assert_eq!(counted(&format!("{decide}{launch}"), ZEROS)?, [6, 3, 2, 1]);
    assert_eq!(counted(&format!("{launch}{decide}"), ZEROS)?, [0; 4]);
    Ok(())
}

#[test]
fn every_way_to_run_reads_the_size() -> Result<()> {
    let runs = format!(
        "[[pass]]\nshader = 'main:decide'\n{}[[pass]]\nlaunch = {{ buffer = 'sizes', offset = 4 }}\n",
        dispatch("{ buffer = 'sizes', offset = 4 }")
    );
    let (folder, scene) = scene(&runs, ZEROS);
    let scene = scene?;
    assert_eq!(scene.launch()?.read_buffer::<u32>("count")?, [30, 3, 2, 1]);
    let each = scene.launch_each()?;
    assert_eq!(each[1].read_buffer::<u32>("count")?, [24, 3, 2, 1]);
    // Another order of workgroups and other rounding change nothing.
    assert!(scene.sanitize()?.is_empty() && scene.many_seeds(2)?.is_empty());
    let text = format!(
        "{}\n[expect]\n[[expect.buffer]]\nname = 'count'\nu32 = [30, 3, 2, 1]\n",
        "include = 'whole.toml'"
    );
    let whole = SCENE_HEAD.to_owned() + &runs;
    std::fs::write(folder.path().join("whole.toml"), whole).expect("a file");
    std::fs::write(folder.path().join("scene.toml"), format!("version = 1\n{text}")).expect("a file");
    for arguments in [
        &["run", "scene.toml", "--dump", "count"][..],
        &["run", "scene.toml", "--stats"],
        &["run", "scene.toml", "--lanes", "1", "--dump", "count"],
        &["run", "scene.toml", "--sanitize"],
        &["run", "scene.toml", "--many-seeds", "2"],
        &["run", "scene.toml", "--perturb", "2"],
        &["trace-one-ray", "scene.toml", "--pass", "1", "--invocation", "11,1,0"],
        &["trace-one-ray", "scene.toml", "--pass", "2", "--pixel", "2,1"],
        &["test", "."],
    ] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"))
            .args(arguments)
            .current_dir(folder.path())
            .output()
            .expect("the command starts");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?}: {text}");
    }
    Ok(())
}

const SCENE_HEAD: &str = "version = 1\n[shaders]\nmain = 'main.wgsl'\nlaunched = 'launched.wgsl'\n[pipeline]\n\
    raygen = 'launched:launched'\n[resources.sizes]\ntype = 'storage_buffer'\nbinding = 0\nsize = 32\n\
    data = { zeros = 32 }\n[resources.count]\ntype = 'storage_buffer'\nbinding = 1\ndata = { zeros = 16 }\n";

#[test]
fn mistakes_are_told() {
    for (groups, words) in [
        ("{ buffer = 'sizes', offset = 2 }", "VUID-vkCmdDispatchIndirect-offset-02710"),
        ("{ buffer = 'sizes', offset = 24 }", "VUID-vkCmdDispatchIndirect-offset-00407"),
        ("{ buffer = 'view', offset = 20 }", "extends past the end of `view`, which has 28 bytes"),
        ("{ buffer = 'apart', offset = 8 }", "extends past the end of `apart`"),
        ("{ buffer = 'none' }", "no resource is named `none`"),
        ("{ offset = 4 }", "`buffer` is missing"),
        ("{ buffer = 'sizes', size = 4 }", "unknown key `size`"),
    ] {
        let error = counted(&dispatch(groups), ZEROS).expect_err(groups);
        assert!(error.render().contains(words), "{groups}: {}", error.render());
    }
    // What a shader wrote is too much for one axis, and for all.
    let own = dispatch("{ buffer = 'sizes' }");
    for words in ["[4294967295, 1, 1, 0, 0, 0, 0, 0]", "[1000000, 1000000, 1000, 0, 0, 0, 0, 0]"] {
        let error = counted(&own, words).expect_err(words);
        assert_eq!(error.kind(), ErrorKind::InvalidArgument, "{}", error.render());
        assert!(error.render().contains("`sizes`"), "{}", error.render());
    }
    let launch = "[[pass]]\nlaunch = { buffer = 'sizes' }\n";
    let error = counted(launch, "[65536, 65536, 1, 0, 0, 0, 0, 0]").expect_err("too many");
    assert!(error.render().contains("`sizes`"), "{}", error.render());
}
