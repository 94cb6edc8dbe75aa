//! `--shadow`, `--perturb` and `[expect.stable]` on shaders with a planted mistake, and on their
//! twins without it.

use std::process::{Command, Output};

use anyhit::Result;
use anyhit_cases::stability::shadow::shadow_one;
use anyhit_cases::stability::{Perturbation, perturb, shadow};
use serde_json::Value;

const FOLDER: &str = "shaders/pass/stability";

fn anyhit(arguments: &[&str], threads: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).env("NO_COLOR", "1").env("RAYON_NUM_THREADS", threads);
    command.output().expect("the program starts")
}

fn scene(case: &str) -> String {
    format!("{FOLDER}/{case}/scene.toml")
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn lines_that_matter(report: &Value) -> Vec<(String, u64)> {
    let lines = report["lines"].as_array().expect("lines").iter();
    let matter = lines.filter(|line| line["matters"] == true);
    let place = |line: &Value| {
        let file = line["file"].as_str().expect("a file").rsplit('/').next().expect("a name").to_owned();
        (file, line["line"].as_u64().expect("a line"))
    };
    matter.map(place).collect()
}

#[test]
fn the_shadow_finds_the_line_that_cancels() {
    let output = anyhit(&["run", &scene("cancellation"), "--shadow", "--json"], "2");
    assert!(output.status.success(), "{output:?}");
    let report = json(&output);
    let worst = &report["lines"][0];
    // `float discriminant = b * b - a * c;`: both products are near 1234.5^2, and what is left of
    // 24 bits is about 1, 2^20.5 less.
    assert_eq!(worst["line"], 13, "{report:#}");
    assert_eq!(worst["text"], "float discriminant = b * b - a * c;");
    assert!(worst["cancellations"].as_u64() >= Some(3), "{worst:#}");
    assert!(worst["bits_lost"].as_f64() > Some(15.0), "{worst:#}");
    // The error goes on through the report, the closest-hit shader and the payload, and no further
    // bit is lost on the way: the root halves it.
    let matter = lines_that_matter(&report);
    let inherits = |file: &str, line: u64| {
        let found =
            |one: &&Value| one["line"] == line && one["file"].as_str().is_some_and(|of| of.ends_with(file));
        report["lines"].as_array().expect("lines").iter().find(found).cloned().expect("the line")
    };
    assert_eq!(matter[0], ("main.rint".to_owned(), 13));
    let reported = inherits("main.rint", 15);
    assert!(reported["relative_error"].as_f64() < worst["relative_error"].as_f64(), "{reported:#}");
    // The distance of about 1233.5 is off by what the root of about 0.9 is: the error of 1/1350 of
    // it.
    let carried = inherits("main.rgen", 14);
    let error = carried["relative_error"].as_f64().expect("an error");
    assert!(error > 1e-6 && error < 1e-4, "the shadow came through the payload: {carried:#}");
}

#[test]
fn the_shadow_finds_nothing_in_the_recentred_twin() {
    let output = anyhit(&["run", &scene("recentred"), "--shadow"], "2");
    assert!(output.status.success(), "{output:?}");
    let text = text(&output);
    assert!(text.contains("no line loses much precision, and no decision changes"), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
}

#[test]
fn one_ray_has_a_shadow_of_its_own() {
    let pixel = &["trace-one-ray", &scene("cancellation"), "--pixel", "1,0", "--shadow", "--json"];
    let report = json(&anyhit(pixel, "1"));
    assert_eq!(report["lines"][0]["line"], 13);
    assert_eq!(report["lines"][0]["worst_launch_id"], serde_json::json!([1, 0, 0]));
}

#[test]
fn perturbation_finds_the_branch_that_is_not_stable() {
    let output = anyhit(&["run", &scene("unstable-branch"), "--perturb", "16", "--json"], "2");
    assert_eq!(output.status.code(), Some(1), "an output is not stable");
    let report = json(&output);
    assert_eq!(report["stable"], false);
    let outputs = report["outputs"].as_array().expect("outputs");
    assert_eq!(outputs.len(), 1, "{report:#}");
    assert!(outputs[0]["name"].as_str().is_some_and(|name| name.starts_with("`image` texel")));
    // `if ((column & 1) == 0)`, where column is the quotient that Vulkan gives 2.5 units.
    let branches = report["branches"].as_array().expect("branches");
    assert_eq!(branches.len(), 1, "{report:#}");
    assert_eq!((&branches[0]["line"], &branches[0]["what"]), (&12.into(), &"branch".into()));
    assert_eq!(branches[0]["text"], "if ((column & 1) == 0) {");
}

#[test]
fn perturbation_finds_nothing_in_the_stable_twins() {
    for case in ["stable-branch", "recentred"] {
        for envelope in ["vulkan", "nvidia"] {
            let arguments = ["run", &scene(case), "--perturb", "16", "--envelope", envelope];
            let output = anyhit(&arguments, "2");
            let text = text(&output);
            assert!(output.status.success(), "{case}: {text}");
            assert!(text.ends_with("the output is stable\n"), "{case}: {text}");
        }
    }
}

#[test]
fn perturbation_depends_on_the_seed_and_not_on_threads() {
    let run = |seed: &str, threads: &str| {
        let arguments = ["run", &scene("unstable-branch"), "--perturb", "4", "--seed", seed, "--json"];
        json(&anyhit(&arguments, threads))
    };
    let one = run("7", "1");
    assert_eq!(one, run("7", "4"));
    assert_ne!(one["branches"], run("8", "4")["branches"]);
}

#[test]
fn a_case_that_must_be_stable_fails_by_name() {
    let folder = std::env::temp_dir().join(format!("anyhit-stability-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let root = env!("CARGO_MANIFEST_DIR");
    let scene = std::fs::read_to_string(format!("{root}/{}", scene("unstable-branch"))).expect("a scene");
    let scene = scene.replace("../../../..", root) + "\n[expect.stable]\nruns = 8\n";
    std::fs::write(folder.join("scene.toml"), scene).expect("written");
    // Its shaders are those of the repository, which need not hold that folder.
    let output = anyhit(&["test", &folder.display().to_string(), "--root", "/"], "2");
    let text = text(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("not stable: output `image` texel"), "{text}");
    assert!(text.contains("not stable: branch at main.rchit:12"), "{text}");
    std::fs::remove_dir_all(&folder).expect("removed");
}

#[test]
fn the_suite_sums_the_shadows_of_its_tests_up() {
    let arguments = ["test", FOLDER, "--shadow", "--format", "json"];
    let report = json(&anyhit(&arguments, "2"));
    let lines = report["shadow"]["lines"].as_array().expect("lines").iter();
    let texts: Vec<_> = lines.filter_map(|line| line["text"].as_str()).collect();
    // What is decided otherwise stands before what only loses bits, which stands before all else.
    let place = |text: &str| texts.iter().position(|one| *one == text).expect("the line");
    assert!(place("rayQueryProceedEXT(query);") < place("float discriminant = b * b - a * c;"));
}

#[test]
fn ray_queries_have_shadows_of_their_rays() {
    let report = json(&anyhit(&["run", &scene("query"), "--shadow", "--json"], "1"));
    let line = |number: u64| {
        let mut lines = report["lines"].as_array().expect("lines").iter();
        lines.find(|line| line["line"] == number).cloned().expect("the line")
    };
    // 0.25 in f32, 0.3 in f64, and the floor's edge between: of two queries on each of these lines
    // one has an origin that does not cancel, or ignores its candidate.
    for proceeds in [20, 23] {
        assert_eq!(line(proceeds)["hits_changed"], 1, "{report:#}");
    }
    let flips: u64 = report["lines"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|line| line["hits_changed"].as_u64())
        .sum();
    assert_eq!(flips, 2, "{report:#}");
    // The origin that the query tells has the error of the one that it was given: (0.3 - 0.25) /
    // 0.3.
    let told = line(29)["relative_error"].as_f64().expect("an error");
    assert!((told - 1.0 / 6.0).abs() < 1e-6, "{told}");
}

#[test]
fn perturbation_tells_where_a_query_hits_something_else() {
    let output = anyhit(&["run", &scene("query"), "--perturb", "8", "--json"], "2");
    assert_eq!(output.status.code(), Some(1));
    let report = json(&output);
    let branches = report["branches"].as_array().expect("branches");
    assert!(branches.iter().all(|one| one["what"] == "hit"), "{report:#}");
    let lines: Vec<_> = branches.iter().map(|one| one["line"].as_u64()).collect();
    assert_eq!(lines, [Some(20), Some(23)]);
}

#[test]
fn a_picture_is_written_before_its_stability_is_told() {
    let picture = std::env::temp_dir().join(format!("anyhit-stability-{}.png", std::process::id()));
    let path = picture.display().to_string();
    let render = |more: &[&str]| {
        let mut arguments = vec!["render", "shaders/pass/stability/unstable-branch/scene.toml", "-o", &path];
        arguments.extend(more);
        anyhit(&arguments, "2")
    };
    assert!(render(&[]).status.success());
    let plain = std::fs::read(&picture).expect("a picture");
    std::fs::remove_file(&picture).expect("removed");

    let output = render(&["--perturb", "16"]);
    let told = text(&output);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("branch at main.rchit:12 changes first in"), "{told}");
    assert_eq!(std::fs::read(&picture).expect("a picture"), plain, "the picture is the plain one");

    let report = json(&render(&["--shadow", "--json"]));
    // The launch starts anew: as many results as `anyhit run` finds.
    let run = json(&anyhit(&["run", &scene("unstable-branch"), "--shadow", "--json"], "2"));
    assert_eq!(report, run);
    assert_eq!(render(&["--json"]).status.code(), Some(2), "nothing to print as JSON");
    std::fs::remove_file(&picture).expect("removed");
}

#[test]
fn one_ray_is_perturbed_by_itself() {
    let perturbed = |case: &str| {
        anyhit(&["trace-one-ray", &scene(case), "--pixel", "1,0", "--perturb", "16", "--json"], "1")
    };
    // 3 / 3 is either side of 1: the tile is another one.
    let output = perturbed("unstable-branch");
    assert_eq!((output.status.code(), &json(&output)["stable"]), (Some(1), &false.into()));
    let output = perturbed("stable-branch");
    assert_eq!((output.status.code(), &json(&output)["stable"]), (Some(0), &true.into()));
}

#[test]
fn a_suite_is_held_to_stable_outputs_where_asked() {
    let plain = anyhit(&["test", FOLDER], "2");
    assert!(plain.status.success(), "{}", text(&plain));
    let output = anyhit(&["test", FOLDER, "--perturb", "8"], "2");
    let told = text(&output);
    assert_eq!(output.status.code(), Some(1), "{told}");
    let word = |case: &str| {
        let line = told.lines().find(|line| line.ends_with(&format!("/{case}"))).expect("the case");
        line.split_whitespace().next().expect("a word").to_owned()
    };
    let cases = ["unstable-branch", "query", "stable-branch", "recentred"];
    assert_eq!(cases.map(word), ["FAILED", "FAILED", "ok", "ok"]);
    assert!(told.contains("not stable: branch at main.rchit:12"), "{told}");
    assert!(told.contains("required to have stable outputs: 5 of 5 tests, 8 runs"), "{told}");
}

/// What a binding stores has its shadow where another binding of the buffer loads it.
#[test]
fn the_shadow_goes_through_all_bindings_of_a_buffer() {
    let scene = "shaders/pass/resources/rounded-in-a-range/scene.toml";
    let output = anyhit(&["run", scene, "--shadow", "--json"], "2");
    assert!(output.status.success(), "{output:?}");
    // 2^24 + 1/2 is 2^24 in f32: the difference is 0 in place of 1/2.
    let report = json(&output);
    assert!(lines_that_matter(&report).contains(&("main.comp".to_owned(), 12)), "{report:#}");
}

/// What runs beside the shadow is the run itself: it leaves the same behind.
#[test]
fn watched_dispatches_and_buffers_have_shadows() -> Result<()> {
    use anyhit_debugger::session::{ExplainRequest, Session};
    use anyhit_scene::{DiskFiles, LoadOptions, assemble, load};
    let scene =
        load("shaders/pass/arithmetic/basics/scene.toml".as_ref(), &DiskFiles, &LoadOptions::default())?;
    let assembled = assemble(&scene)?;
    let (found, trap) = shadow(&scene, &assembled)?;
    assert!(trap.is_none() && found.results > 0);
    let quiet = Perturbation { runs: 1, ..Perturbation::default() };
    // 1/3 and the like move, but by far less than a percent.
    let perturbed = perturb(&scene, &assembled, &quiet)?;
    assert!(perturbed.traps.is_empty());
    let session = Session::new(scene)?;
    let (_, which) = session.resolve(&ExplainRequest::Pixel([0, 0, 0]))?;
    let (one, _) = shadow_one(session.scene(), session.assembled(), &which)?;
    assert!(one.results > 0 && one.results < found.results);
    Ok(())
}

/// A dispatch that adds 5000 times 3/4 to what is stored in 16 bits or fewer, and reads it again.
#[cfg(feature = "glsl")]
fn stored(name: &str, head: &str, declared: &str, body: &str, resource: &str) -> Value {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("stored").join(name);
    std::fs::create_dir_all(&folder).expect("a writable folder");
    let shader = format!(
        "#version 460\n{head}\nlayout(local_size_x = 1) in;\n{declared}\nvoid main() {{\n\
         \x20   for (int i = 0; i < 5000; ++i)\n        {body}\n}}\n"
    );
    std::fs::write(folder.join("a.comp"), shader).expect("a writable folder");
    let scene = format!(
        "version = 1\n[shaders]\na = 'a.comp'\n[[dispatch]]\nshader = 'a'\n[resources.sum]\nbinding = 0\n{resource}\n"
    );
    let path = folder.join("scene.toml");
    std::fs::write(&path, scene).expect("a writable folder");
    let output = anyhit(&["run", &path.display().to_string(), "--shadow", "--json"], "1");
    assert!(output.status.success(), "{output:?}");
    json(&output)
}

#[cfg(feature = "glsl")]
#[test]
fn storage_in_few_bits_is_reported_where_it_is_read_again() {
    const HALF: &str = "#extension GL_EXT_shader_16bit_storage : require\n#extension GL_EXT_shader_explicit_arithmetic_types_float16 : require";
    let image =
        |format: &str| format!("type = 'storage_image'\nformat = '{format}'\nsize = [1, 1]\nfill = 0");
    let declared = |format: &str| format!("layout(binding = 0, {format}) uniform image2D sum;");
    let add = |by: &str| format!("imageStore(sum, ivec2(0), vec4(imageLoad(sum, ivec2(0)).x + {by}));");
    let buffer = "type = 'storage_buffer'\nsize = 4";
    let cases = [
        ("r16f", "", declared("r16f"), add("0.75"), image("r16f"), 16),
        ("rgba16f", "", declared("rgba16f"), add("0.75"), image("rgba16f"), 16),
        (
            "buffer",
            HALF,
            "layout(binding = 0) buffer Sum { float16_t sum; };".to_owned(),
            "sum = float16_t(float(sum) + 0.75);".to_owned(),
            buffer.to_owned(),
            16,
        ),
        (
            "packed",
            "",
            "layout(binding = 0) buffer Sum { uint sum; };".to_owned(),
            "sum = packHalf2x16(vec2(0.0, unpackHalf2x16(sum).y + 0.75));".to_owned(),
            buffer.to_owned(),
            16,
        ),
    ];
    for (name, head, declared, body, resource, bits) in cases {
        let report = stored(name, head, &declared, &body, &resource);
        let worst = &report["lines"][0];
        // From 2048 on, where the halves are 2 apart, the sum stays; the last that is read
        // ought to be 4999 * 0.75 = 3749.25: 1 - 2048 / 3749.25 = 0.4538.
        let error = worst["relative_error"].as_f64().expect("a number");
        assert!((0.453..0.454).contains(&error), "{name}: {report:#}");
        assert_eq!(worst["storage_bits"], bits, "{name}: {report:#}");
        assert_eq!(worst["matters"], true, "{name}: {report:#}");
        // From 512 on three quarters are no longer whole steps: more than half of the reads
        // follow, of up to four components each.
        let read = worst["read_back"].as_u64().expect("a count");
        assert!((2500..20_000).contains(&read), "{name}: {report:#}");
        // Multiples of 1/4 up to 4 are halves.
        let exact = body.replace("0.75", "(i < 16 ? 0.25 : 0.0)");
        let report = stored(&format!("{name}-exact"), head, &declared, &exact, &resource);
        assert!(lines_that_matter(&report).is_empty(), "{name}: {report:#}");
    }
    // Fixed point: a thousandth is less than half of a step of 1/255.
    let fixed = [
        ("rgba8", declared("rgba8"), add("0.001"), image("rgba8"), 8),
        (
            "unorm",
            "layout(binding = 0) buffer Sum { uint sum; };".to_owned(),
            "sum = packUnorm4x8(unpackUnorm4x8(sum) + 0.001);".to_owned(),
            buffer.to_owned(),
            8,
        ),
    ];
    for (name, declared, body, resource, bits) in fixed {
        let report = stored(name, "", &declared, &body, &resource);
        let worst = &report["lines"][0];
        // It stays 0, and ought to be something.
        assert_eq!(worst["relative_error"], 1.0, "{name}: {report:#}");
        assert_eq!(worst["storage_bits"], bits, "{name}: {report:#}");
    }
}
