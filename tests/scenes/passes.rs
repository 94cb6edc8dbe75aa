//! Frames of several passes: pipelines, resources and names of their own, from files and from Rust.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use anyhit::{ErrorKind, LoadedScene, Result, StructData};
use anyhit_cases::stability::{Envelope, Perturbation, perturb, shadow};
use anyhit_debugger::ExplainRequest;
use anyhit_engine::accel::Motion;
use anyhit_scene::{DiskFiles, LoadOptions, assemble, load};
use serde_json::Value;

const FRAME: &str = "shaders/pass/frames/ping-pong/scene.toml";

fn row(outcome: &anyhit_cases::loaded_scene::SceneOutcome, image: &str) -> Result<[f64; 4]> {
    let image = outcome.image(image)?;
    Ok([0, 1, 2, 3].map(|x| image.at(x, 0)[0]))
}

#[test]
fn each_pass_leaves_what_the_next_one_finds() -> Result<()> {
    let scene = LoadedScene::open(FRAME)?;
    let passes = scene.launch_each()?;
    let names: Vec<_> = passes.iter().map(|pass| pass.pass.as_deref()).collect();
    assert_eq!(names, [Some("primary"), Some("ao"), Some("tonemap")]);
    // The floor lies two below the rays' origins, up to x = 2.
    let (nothing, depths) = ([0.0; 4], [2.0, 2.0, -1.0, -1.0]);
    assert_eq!([row(&passes[0], "first")?, row(&passes[0], "second")?], [nothing, depths]);
    assert_eq!(passes[0].read_buffer::<u32>("result")?, [0; 4]);
    // The second pass has both images exchanged: it reads the depths and leaves them.
    let light = [0.25, 1.0, 1.0, 1.0];
    assert_eq!([row(&passes[1], "first")?, row(&passes[1], "second")?], [light, depths]);
    assert_eq!(passes[2].read_buffer::<u32>("result")?, [1, 4, 4, 4]);
    assert_eq!([0, 1, 2].map(|at| passes[at].stats.rays), [4, 2, 0]);
    let whole = scene.launch()?;
    assert_eq!((whole.stats.rays, whole.pass.as_deref()), (6, None));

    // By itself a pass finds the images as the scene describes them: zeros. A depth of 0 is a hit
    // at z = 2, from where the lid one above is met at x = 0.
    let alone = scene.launch_pass("ao")?;
    assert_eq!((row(&alone, "first")?, alone.stats.rays), (light, 4));
    assert_eq!(scene.launch_pass("2")?.read_buffer::<u32>("result")?, [0; 4]);
    let error = scene.launch_pass("oa").unwrap_err();
    assert_eq!(error.message(), "the scene has no pass `oa`");
    assert!(error.render().contains("passes: 0 `primary`, 1 `ao`, 2 `tonemap`"), "{error:?}");
    Ok(())
}

#[test]
fn records_and_push_constants_are_set_by_the_names_of_members() -> Result<()> {
    let text = std::fs::read_to_string(FRAME).expect("the scene");
    // The third pass has the scene's own push constants then: 8 times 1.
    let text = text.replace("push_constants = { f32 = [4, 1] }", "");
    let mut scene = LoadedScene::from_text(FRAME, &text)?;
    let result = |scene: &LoadedScene| scene.launch()?.read_buffer::<u32>("result");
    assert_eq!(result(&scene)?, [2, 8, 8, 8]);
    let constants = StructData::push_constants(&scene.module("tonemap")?)?;
    scene.set_push_constants_data(&constants.set("exposure", 2.0)?.set("gain", 6.0)?)?;
    assert_eq!(result(&scene)?, [3, 12, 12, 12]);
    scene.set_push_constants_bytes(bytemuck::bytes_of(&[4.0_f32, 4.0]))?;
    assert_eq!(result(&scene)?, [4, 16, 16, 16]);

    // The record by its name, and by that of its shader.
    let record = StructData::shader_record(&scene.module("occluded")?)?;
    scene.set_shader_record_data("shadow", &record.set("light", 0.5)?)?;
    assert_eq!(result(&scene)?, [8, 16, 16, 16]);
    scene.set_shader_record("occluded", &0.125_f32)?;
    assert_eq!(result(&scene)?, [2, 16, 16, 16]);
    // All of it holds where the scene is read again.
    scene.set_launch_size([4, 1])?;
    assert_eq!(result(&scene)?, [2, 16, 16, 16]);
    let error = scene.set_shader_record("shdow", &0_u32).unwrap_err();
    assert_eq!(error.message(), "the scene has no shader record `shdow`");
    assert!(error.render().contains("did you mean `shadow`?"), "{}", error.render());
    Ok(())
}

#[test]
fn an_instance_that_is_moved_says_whether_it_moves() -> Result<()> {
    let at = |z: f32| [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, z]];
    let mut scene = LoadedScene::open(FRAME)?;
    let depth =
        |scene: &LoadedScene| Ok::<_, anyhit::Error>(row(&scene.launch_pass("primary")?, "second")?[0]);
    assert_eq!((scene.motion(0)?, scene.transform(0)?), (None, at(0.0)));
    // The rays have no time, which is 0.
    scene.set_motion(0, Motion::Matrix([at(-0.5), at(-5.0)]))?;
    assert_eq!((depth(&scene)?, scene.transform(0)?), (2.5, at(-0.5)));
    scene.set_transform(0, at(-0.75))?;
    assert_eq!((depth(&scene)?, scene.motion(0)?), (2.75, None));
    let error = scene.set_motion(1, Motion::Matrix([at(0.0); 2])).unwrap_err();
    assert_eq!(error.message(), "the scene has no instance 1, only 1");
    Ok(())
}

#[test]
fn rays_and_pixels_are_explained_in_their_pass() -> Result<()> {
    let scene = LoadedScene::open(FRAME)?;
    let pixel = || Box::new(ExplainRequest::Pixel([0, 0, 0]));
    let told = scene.explain(ExplainRequest::InPass("ao".into(), pixel()))?;
    assert!(told.contains("pass ao, pixel (0, 0) of 4 x 1"), "{told}");
    // The record's name, and what the hit shader of this pipeline gives.
    assert!(told.contains("shadow") && told.contains("0.25"), "{told}");
    let first = scene.explain(ExplainRequest::Pixel([0, 0, 0]))?;
    assert!(first.contains("pass primary") && first.contains("depth.rchit"), "{first}");
    let error = scene.explain(ExplainRequest::InPass("tonemap".into(), pixel())).unwrap_err();
    assert_eq!(error.message(), "pass `tonemap` is a dispatch of a compute shader, not a launch");
    let invocation = ExplainRequest::Invocation { dispatch: 0, id: [1, 0, 0] };
    let told = scene.explain(ExplainRequest::InPass("2".into(), Box::new(invocation.clone())))?;
    assert!(told.contains("pass tonemap, invocation (1, 0, 0) of dispatch 0"), "{told}");
    let error = scene.explain(ExplainRequest::InPass("ao".into(), Box::new(invocation))).unwrap_err();
    assert_eq!(error.message(), "pass `ao` is a launch, not a dispatch");
    Ok(())
}

fn anyhit(arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).env("NO_COLOR", "1").current_dir(env!("CARGO_MANIFEST_DIR"));
    let Output { status, stdout, stderr } = command.output().expect("the program starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (status.code(), text(stdout), text(stderr))
}

#[test]
fn commands_take_frames() {
    let (code, out, err) = anyhit(&["trace-one-ray", FRAME, "--pass", "ao", "--pixel", "0,0", "--json"]);
    assert_eq!(code, Some(0), "{err}");
    let found: Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!(found["pass"], "ao");
    let trace = &found["root"]["steps"][0];
    assert_eq!((&trace["hit"]["t"], &trace["payload_after"]["value"]), (&3.0.into(), &0.25.into()));

    // The first of the scene's rays says its own pass.
    let (_, out, _) = anyhit(&["trace-one-ray", FRAME]);
    assert!(out.contains("ray \"up from the floor\", pass ao"), "{out}");
    let (code, _, err) = anyhit(&["trace-one-ray", FRAME, "--pass", "3", "--pixel", "0,0"]);
    assert!(code == Some(2) && err.contains("the scene has no pass `3`"), "{err}");

    let picture = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("passes.raw");
    let (code, out, err) = anyhit(&["render", FRAME, "--stats", "-o", picture.to_str().expect("UTF-8")]);
    assert_eq!(code, Some(0), "{err}");
    assert!(out.contains("rays                      6 "), "{out}");
    let words = std::fs::read(&picture).expect("the picture");
    assert_eq!(words, bytemuck::cast_slice::<f32, u8>(&[2.0, 2.0, -1.0, -1.0]));

    // An error without a picture of anything comes in one shape.
    let (code, out, err) = anyhit(&["trace-one-ray", FRAME, "--pass", "tonemap", "--pixel", "0,0", "--json"]);
    let told: Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!((code, &told["errors"][0]["class"]), (Some(2), &"error".into()), "{err}");
}

#[test]
fn rounding_is_examined_in_all_passes() -> Result<()> {
    let scene = load(Path::new(FRAME), &DiskFiles, &LoadOptions::default())?;
    let assembled = assemble(&scene)?;
    let (found, trap) = shadow(&scene, &assembled)?;
    assert!(trap.is_none());
    let results = |text: &str| {
        let line = found.lines.iter().find(|(place, _)| place.text.as_deref() == Some(text));
        line.map(|(_, line)| line.results)
    };
    // Four invocations of the first launch; those two of the second that read a depth, through the
    // image that stands at the other's place; four of the dispatch.
    assert_eq!(results("float x = left + 0.5;"), Some(4));
    assert_eq!(results("float floor_z = 2.0 - depth;"), Some(2));
    assert_eq!(results("float exposed = lit * exposure;"), Some(4));

    // Sums and products here are exact, and t moves by ulps: all stay within a percent.
    let perturbation = Perturbation { runs: 8, envelope: Envelope::Nvidia, ..Perturbation::default() };
    assert!(perturb(&scene, &assembled, &perturbation)?.is_stable());
    // Without a tolerance the picture of depths is not, and it alone: the second pass gives the
    // record's number wherever it hits.
    let exact = perturb(&scene, &assembled, &Perturbation { tolerance: 0.0, ..perturbation })?;
    let names: Vec<&str> = exact.outputs.iter().map(|output| output.name.as_str()).collect();
    assert!(names.len() == 1 && names[0].starts_with("`second`"), "{names:?}");
    Ok(())
}

#[test]
fn a_trap_says_in_which_pass_it_is() -> Result<()> {
    let mut scene = LoadedScene::open(FRAME)?;
    scene.set_buffer_bytes("result", &[0; 4])?;
    let error = scene.launch().unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Trap);
    assert!(error.render().contains("in pass `tonemap` of the scene"), "{}", error.render());
    Ok(())
}

/// An image that was stored to is sampled by the next pass, and a buffer without a descriptor
/// stands in that of another one.
#[cfg(feature = "wgsl")]
#[test]
fn a_descriptor_keeps_its_type_and_takes_another_content() -> Result<()> {
    const SHADERS: &str = "
        @group(0) @binding(0) var canvas: texture_storage_2d<r32float, write>;
        @group(0) @binding(1) var seen: texture_2d<f32>;
        @group(0) @binding(2) var<storage, read_write> found: array<f32, 4>;
        @group(0) @binding(3) var<storage, read_write> other: array<f32, 4>;
        @compute @workgroup_size(4) fn draw(@builtin(local_invocation_index) at: u32) {
            textureStore(canvas, vec2u(at, 0u), vec4f(f32(at) + 1.0, 0.0, 0.0, 0.0));
        }
        @compute @workgroup_size(4) fn look(@builtin(local_invocation_index) at: u32) {
            found[at] = textureLoad(seen, vec2u(at, 0u), 0).x;
        }
        @compute @workgroup_size(4) fn tenfold(@builtin(local_invocation_index) at: u32) {
            found[at] = 10.0 * other[at];
        }";
    const SCENE: &str = "version = 1\nlaunch = 4\n[shaders.all]\nsource = 'passes.wgsl'\n\
        [[pass]]\nshader = 'all:draw'\n\
        [[pass]]\nshader = 'all:look'\nresources = { seen = 'canvas', found = 'apart' }\n\
        [[pass]]\nshader = 'all:tenfold'\nresources = { other = 'apart' }\n\
        [resources.canvas]\ntype = 'storage_image'\nbinding = 0\nformat = 'r32f'\n\
        [resources.seen]\ntype = 'sampled_image'\nbinding = 1\nformat = 'r32f'\nsize = [4, 1]\n\
        [resources.found]\ntype = 'storage_buffer'\nbinding = 2\nsize = 16\n\
        [resources.other]\ntype = 'storage_buffer'\nbinding = 3\nsize = 16\n\
        [resources.apart]\ntype = 'buffer'\nsize = 16\n";
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(folder.join("passes.wgsl"), SHADERS).expect("a writable folder");
    let passes = LoadedScene::from_text(folder.join("passes.toml"), SCENE)?.launch_each()?;
    assert_eq!(row(&passes[0], "canvas")?, [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(passes[1].read_buffer::<f32>("found")?, [0.0; 4]);
    assert_eq!(passes[1].read_buffer::<f32>("apart")?, [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(passes[2].read_buffer::<f32>("found")?, [10.0, 20.0, 30.0, 40.0]);
    assert_eq!(passes[2].read_buffer::<f32>("other")?, [0.0; 4]);
    Ok(())
}
