//! The lints about rays that follow each other, in other forms than those of the cases in
//! `shaders/sanitize`: other languages, ray queries, hit objects, callable shaders, path loops, and
//! instances that no ray enters.

use std::path::Path;

use anyhit_cases::sanitized::run_sanitized;
use anyhit_sanitize::Levels;
use anyhit_scene::{LoadOptions, SceneFiles, assemble, load_text};

/// The rules that a rule's scene breaks, each as often as there are findings, with some texts
/// replaced.
fn broken(rule: &str, replaced: &[(&str, &str)]) -> Vec<&'static str> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/sanitize").join(rule).join("scene.toml");
    let mut text = std::fs::read_to_string(&path).expect("a scene");
    for (from, to) in replaced {
        assert!(text.contains(from), "{from} in {}", path.display());
        text = text.replace(from, to);
    }
    let scene = load_text(&path, &text, &SceneFiles::default(), &LoadOptions::default());
    let scene = scene.unwrap_or_else(|error| panic!("{}", error.render()));
    let assembled = assemble(&scene).unwrap_or_else(|error| panic!("{}", error.render()));
    let run = run_sanitized(&scene, &assembled, &assembled.resources, &Levels::default());
    let run = run.unwrap_or_else(|error| panic!("{}", error.render()));
    run.outcome.unwrap_or_else(|error| panic!("{}", error.render()));
    run.findings.iter().map(|finding| finding.rule.id).collect()
}

#[test]
fn undecided_candidates_of_wgsl() {
    assert_eq!(broken("rq-undecided", &[("broken.comp", "broken.wgsl")]), ["rq-undecided"]);
    assert!(broken("rq-undecided", &[("broken.comp", "mended.wgsl")]).is_empty());
}

#[test]
fn candidates_that_are_all_opaque_need_no_decision() {
    let weeds = "[geometry.weeds]\n";
    assert!(broken("rq-undecided", &[(weeds, &format!("{weeds}opaque = true\n"))]).is_empty());
}

/// A dispatch in place of the launch of a rule's scene.
fn as_dispatch(scene: &str, shader: &str) -> String {
    let rest = scene.split("[geometry").skip(1).map(|part| format!("[geometry{part}"));
    let head = format!(
        "version = 1\n[shaders]\nmain = \"../../../spirv-fixtures/sanitize/{shader}.spv\"\n\
         [[dispatch]]\nshader = \"main\"\n"
    );
    head + &rest.collect::<String>()
}

/// [`broken`] of a dispatch.
fn broken_by_dispatch(rule: &str, shader: &str) -> Vec<&'static str> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/sanitize").join(rule).join("scene.toml");
    let text = std::fs::read_to_string(&path).expect("a scene");
    let dispatch = as_dispatch(&text, &format!("{rule}/{shader}"));
    broken(rule, &[(&text, &dispatch)])
}

#[test]
fn ray_queries_begin_on_surfaces() {
    assert_eq!(broken_by_dispatch("ray-from-surface", "broken.comp"), ["ray-from-surface"]);
    assert!(broken_by_dispatch("ray-from-surface", "mended.comp").is_empty());
}

#[test]
fn a_path_in_a_loop_begins_on_surfaces() {
    let path = [("main.rgen", "path.rgen"), ("broken.rchit", "path.rchit")];
    let found = broken("ray-from-surface", &path);
    assert!(found.contains(&"ray-from-surface"), "{found:?}");
    // The path's rays choose the first miss record alone.
    assert!(
        found.iter().all(|rule| ["ray-from-surface", "sbt-record-unreached"].contains(rule)),
        "{found:?}"
    );
}

#[test]
fn a_shader_that_a_hit_object_executes_has_the_time_of_its_ray() {
    assert_eq!(broken("ray-loses-time", &[("main.rgen", "execute.rgen")]), ["ray-loses-time"]);
    let mended = [("main.rgen", "execute.rgen"), ("broken.rchit", "mended.rchit")];
    assert!(broken("ray-loses-time", &mended).is_empty());
}

#[test]
fn a_ray_may_be_without_time_where_nothing_moves() {
    let found = broken("ray-loses-time", &[("motion = { translate = [4, 0, 0] }", "")]);
    assert_eq!(found, ["ray-motion-needs-as"]);
}

#[test]
fn boxes_that_no_ray_enters_are_known_to_be_transformed() {
    let far = ("translate = [0.5, 0, 0]", "translate = [0, 90, 0]");
    assert_eq!(broken("world-ray-in-intersection", &[far]), ["world-ray-in-intersection"; 2]);
    let mended = ("broken.rint", "mended.rint");
    assert!(broken("world-ray-in-intersection", &[far, mended]).is_empty());
}

#[test]
fn an_instance_that_only_moves_keeps_directions() {
    let found = broken("world-ray-in-intersection", &[("scale = 2\n", "")]);
    assert_eq!(found, ["world-ray-in-intersection"]);
    let still = [("scale = 2\n", ""), ("translate = [0.5, 0, 0]", "")];
    assert!(broken("world-ray-in-intersection", &still).is_empty());
}

#[test]
fn ray_queries_generate_hits_in_object_space() {
    let rule = "world-ray-in-intersection";
    assert_eq!(broken_by_dispatch(rule, "broken.comp"), [rule]);
    assert!(broken_by_dispatch(rule, "mended.comp").is_empty());
}

#[test]
fn callable_data_is_read_by_nobody() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/sanitize/payload-unread/scene.toml");
    let text = std::fs::read_to_string(path).expect("a scene");
    let call = "version = 1\nlaunch = 4\n[shaders]\n\
        raygen = \"../../../spirv-fixtures/sanitize/payload-unread/call.rgen.spv\"\n\
        colour = \"../../../spirv-fixtures/sanitize/payload-unread/colour.rcall.spv\"\n\
        [pipeline]\nraygen = \"raygen\"\ncallable = [\"colour\"]\n\
        [resources.colours]\ntype = \"storage_buffer\"\nbinding = 1\nsize = 64\n";
    assert_eq!(broken("payload-unread", &[(&text, call)]), ["payload-unread"]);
}

#[test]
fn an_offset_of_the_instance_leaves_records_out() {
    let mended = ("broken.rgen", "mended.rgen");
    let offset = ("geometry = [\"wall\", \"floor\"]", "geometry = [\"wall\", \"floor\"]\nsbt_offset = 1");
    let more = (
        "hit = [{ closest_hit = \"wall\" }, { closest_hit = \"floor\" }]",
        "hit = [{ closest_hit = \"wall\" }, { closest_hit = \"floor\" }, { closest_hit = \"floor\" }]",
    );
    // The wall's record is the first, to which no geometry leads.
    assert_eq!(broken("sbt-record-unreached", &[mended, offset, more]), ["sbt-record-unreached"]);
}
