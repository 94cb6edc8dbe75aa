//! `anyhit trace-one-ray` from the outside: what it says of small scenes, whose facts are derived
//! by hand, and how it answers what makes no sense.
//!
//! `tests/debugger/trace-one-ray/*.stdout` hold renderings, and `BLESS=1 cargo test` writes them
//! anew: they guard the form. The facts are guarded by the expectations here, which nobody blesses.

use std::path::Path;
use std::process::{Command, Output};

use pretty_assertions::assert_eq;
use serde_json::{Value, json};

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .arg("trace-one-ray")
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("the binary of this crate starts")
}

/// What `--json` says.
fn told(scene: &str, arguments: &[&str]) -> Value {
    let scene = format!("tests/debugger/trace-one-ray/{scene}.toml");
    let output = run(&[&[&scene, "--json"], arguments].concat());
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!(
            "{error}: {}{}",
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        )
    })
}

/// Compares text with a file, or writes that where `BLESS` is set.
fn renders(name: &str, arguments: &[&str]) {
    let output = run(arguments);
    assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{name}");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/debugger/trace-one-ray/{name}.stdout"));
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&path, &text).expect("the folder is there");
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(text, expected, "{name}: `BLESS=1 cargo test` if the new form is meant");
}

/// The one member of a payload with a name.
fn member<'a>(payload: &'a Value, name: &str) -> &'a Value {
    let members = payload["value"].as_array().expect("a struct");
    &members.iter().find(|member| member["name"] == name).expect("such a member")["value"]
}

/// The ray at (x + 1/2, y + 1/2) meets the triangle at z = 0 from z = 4 where x + y <= 14.
#[test]
fn an_invocation_of_a_dispatch_is_explained() {
    const SCENE: &str = "shaders/pass/ray-query/compute/scene.toml";
    let explained = |arguments: &[&str]| -> Value {
        let output = run(&[&[SCENE, "--json"], arguments].concat());
        serde_json::from_slice(&output.stdout).expect("JSON")
    };
    let hit = explained(&["--invocation", "3,2"]);
    assert_eq!(hit["dispatch"]["id"], json!([3, 2, 0]));
    assert_eq!(hit["dispatch"]["workgroup_size"], json!([16, 4, 1]));
    let query = &hit["root"]["steps"][0];
    assert_eq!((&query["kind"], &query["origin"]), (&json!("ray_query"), &json!([3.5, 2.5, 4.0])));
    assert_eq!((&query["hit"]["t"], &query["structure"]), (&json!(4.0), &json!("main")));
    assert_eq!(query["instances"][0]["tested"].as_array().map(Vec::len), Some(1));
    assert_eq!((&hit["counts"]["ray_queries"], &hit["writes"]), (&json!(1), &json!([])));
    let missed = explained(&["--invocation", "15,7", "--dispatch", "1"]);
    assert_eq!(missed["root"]["steps"][0]["hit"], Value::Null);
    // The first invocation of a workgroup writes what all of it counted: 15 + 14 + 13 + 12.
    let first = explained(&["--invocation", "0"]);
    assert_eq!(first["writes"].as_array().map(Vec::len), Some(1));
    assert_eq!(first["writes"][0]["after"]["value"], json!(54));
    let text = String::from_utf8(run(&[SCENE, "--invocation", "3,2"]).stdout).expect("UTF-8");
    assert!(
        text.contains("invocation (3, 2, 0) of dispatch 0, 1 x 2 x 1 workgroups of 16 x 4 x 1"),
        "{text}"
    );
    for (arguments, words) in [
        (&["--invocation", "16,0"][..], "invocation 16,0,0 is outside the dispatch of 1 x 2 x 1 workgroups"),
        (&["--invocation", "0", "--dispatch", "2"], "the scene has no dispatch 2"),
        (&["--invocation", "0,a"], "`--invocation 0,a` is not X,Y,Z: `a` is not a non-negative integer"),
        (&["--pixel", "0,0"], "--invocation 0,0,0` explains an invocation of its dispatch"),
    ] {
        let output = run(&[&[SCENE], arguments].concat());
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && error.contains(words), "{words}: {error}");
    }
}

#[test]
fn the_guide_shows_what_is_printed() {
    const BEGIN: &str = "<!-- demo.stdout -->\n```text\n";
    const END: &str = "```\n<!-- end -->";
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/trace-one-ray.md");
    let guide = std::fs::read_to_string(&path).expect("the guide");
    let (before, rest) = guide.split_once(BEGIN).expect("the place where the output begins");
    let (shown, after) = rest.split_once(END).expect("the place where the output ends");
    let printed = String::from_utf8(run(&[]).stdout).expect("UTF-8");
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&path, [before, BEGIN, &printed, END, after].concat()).expect("the guide");
        return;
    }
    assert_eq!(shown, printed, "`BLESS=1 cargo test` if the new form is meant");
}

/// A number that was printed as an `f32`.
fn single(value: &Value) -> f32 {
    value.as_f64().expect("a number") as f32
}

#[test]
fn renderings() {
    let scene = |name: &str| format!("tests/debugger/trace-one-ray/{name}.toml");
    renders("demo", &[]);
    renders("sphere-hit", &[&scene("sphere")]);
    renders("sphere-miss", &[&scene("sphere"), "--ray", "beside"]);
    renders("sphere-pixel", &[&scene("sphere"), "--pixel", "1,0"]);
    renders("any-hit", &[&scene("any-hit")]);
    renders("capsule-side", &[&scene("capsule")]);
    renders("box", &[&scene("box")]);
    renders("ray-query-box", &[&scene("ray-query"), "--pixel", "1,1"]);
    renders("ray-query-opaque", &[&scene("ray-query"), "--pixel", "3,0"]);
    renders("hit-object", &[&scene("hit-object"), "--pixel", "0,0"]);
}

#[test]
fn a_ray_query_tells_what_was_shown_and_decided() {
    // From z = 4 to the box at z = 0; the shader generates 4.5 in it.
    let query = told("ray-query", &["--pixel", "1,1"])["root"]["steps"][0].clone();
    assert_eq!(query["kind"], "ray_query");
    let candidate = &query["candidates"][0];
    assert_eq!(
        (&candidate["is_box"], &candidate["opaque"], &candidate["t"], &candidate["generated"]),
        (&json!(true), &json!(false), &json!(4.0), &json!([4.5]))
    );
    assert_eq!((&query["hit"]["t"], &query["end"]), (&json!(4.5), &json!("complete")));
    let mut tested = query["instances"][0]["tested"].as_array().expect("a list").iter();
    assert!(tested.any(|one| one["geometry"] == 1 && one["verdict"] == "candidate"));
    // The triangle at z = -1 is passed over, the opaque one is not shown.
    let passed = told("ray-query", &["--pixel", "2,0"])["root"]["steps"][0].clone();
    assert_eq!(passed["candidates"][0]["confirmed"], false);
    assert_eq!(passed["hit"], Value::Null);
    let unseen = told("ray-query", &["--pixel", "3,0"])["root"]["steps"][0].clone();
    assert_eq!((&unseen["candidates"], &unseen["hit"]["t"]), (&json!([]), &json!(5.0)));
}

#[test]
fn a_hit_object_is_traced_and_then_executed() {
    let steps = told("hit-object", &["--pixel", "2,0"])["root"]["steps"].clone();
    assert_eq!((&steps[0]["kind"], &steps[0]["shader"]), (&json!("trace"), &Value::Null));
    assert!(steps[0]["no_shader"].as_str().is_some_and(|why| why.contains("hit object")));
    // Nothing is at x = 4: the miss shader of record 1 runs when the object is executed.
    assert_eq!((&steps[1]["kind"], &steps[1]["shader"]["stage"]), (&json!("shader"), &json!("MissKHR")));
}

#[test]
fn a_sphere_is_hit_where_algebra_says() {
    // (4 - t)^2 = 1 has the roots 3 and 5; the normal at (0, 0, 1) is that point itself.
    let transcript = told("sphere", &[]);
    assert_eq!(transcript["version"], 1);
    let ray = &transcript["root"];
    assert_eq!(ray["kind"], "trace");
    let hit = &ray["hit"];
    assert_eq!(
        (&hit["t"], &hit["surface"], &hit["custom_index"]),
        (&json!(3.0), &json!("sphere"), &json!(42))
    );
    assert_eq!(hit["position"], json!([0.0, 0.0, 1.0]));
    assert_eq!(ray["t_max"], "inf");
    let shader = &ray["shader"];
    assert_eq!(
        (&shader["shader"]["stage"], &shader["shader"]["name"]),
        (&json!("ClosestHitKHR"), &json!("shade"))
    );
    assert_eq!(member(&shader["payload_before"], "hits"), 0);
    assert_eq!(member(&shader["payload_after"], "hits"), 1);
    assert_eq!(member(&ray["payload_after"], "normal"), &json!([0.0, 0.0, 1.0]));
    assert_eq!(member(&ray["payload_after"], "t"), 3.0);
    let counts = json!({ "rays": 1, "ray_queries": 0, "shaders": { "ClosestHitKHR": 1 } });
    assert_eq!(transcript["counts"], counts);
}

#[test]
fn a_miss_names_its_record_and_shader() {
    let transcript = told("sphere", &["--ray", "beside"]);
    let ray = &transcript["root"];
    assert_eq!(ray["hit"], Value::Null);
    assert_eq!((&ray["record"]["table"], &ray["record"]["index"]), (&json!("miss"), &json!(0)));
    assert_eq!(ray["instances"][0]["tested"][0]["verdict"], "missed");
    // main.rmiss sets t to -1.
    assert_eq!(member(&ray["payload_after"], "t"), -1.0);
}

#[test]
fn a_mask_drops_an_instance_and_an_interval_a_primitive() {
    // The instance's mask is 6 = 110b, the ray's 1.
    let ray = &told("sphere", &["--ray", "0,0,4 0,0,-1", "--cull-mask", "0b1"])["root"];
    assert_eq!(ray["instances"][0]["verdict"], "masked");
    assert_eq!(ray["hit"], Value::Null);
    let ray = &told("sphere", &["--ray", "0,0,4 0,0,-1", "--t-max", "2.5"])["root"];
    let tested = &ray["instances"][0]["tested"][0];
    assert_eq!((&tested["verdict"], &tested["t"]), (&json!("outside_interval"), &json!(3.0)));
    let ray = &told("sphere", &["--ray", "0,0,4 0,0,-1", "--flags", "CullOpaque"])["root"];
    assert_eq!(ray["instances"][0]["tested"][0]["verdict"], "culled_by_opacity");
    let ray = &told("sphere", &["--ray", "0,0,4 0,0,-1", "--flags", "SkipTriangles"])["root"];
    assert_eq!(ray["instances"][0]["verdict"], "skipped");
    let ray = &told("sphere", &["--ray", "0,0,4 0,0,-1", "--flags", "SkipClosestHitShader"])["root"];
    assert_eq!((&ray["hit"]["t"], &ray["shader"]), (&json!(3.0), &Value::Null));
    assert_eq!(ray["no_shader"], "the ray's flag SkipClosestHitShaderKHR");
}

#[test]
fn a_ray_has_a_time_where_something_moves() {
    let scene = "shaders/pass/motion-blur/traces/scene.toml";
    // The first instance goes from z = 0 to z = -4: at a quarter of the way t = 4 + 1.
    let output = run(&[scene, "--json", "--ray", "0,0,4 0,0,-1", "--time", "0.25"]);
    let transcript: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let ray = &transcript["root"];
    assert_eq!((&ray["time"], &ray["hit"]["t"]), (&json!(0.25), &json!(5.0)));
    assert_eq!(ray["hit"]["object_ray_origin"], json!([0.0, 0.0, 5.0]));
    assert_eq!(ray["instances"][0]["moves"], true);
    let text = String::from_utf8(run(&[scene, "--ray", "half way down"]).stdout).expect("UTF-8");
    let squeezed = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(squeezed.contains("time 0.5") && text.contains("1 triangle, moving"), "{text}");
    // Nothing is told of a time where nothing moves.
    assert_eq!(told("sphere", &["--ray", "beside"])["root"]["time"], Value::Null);
    let late = run(&[scene, "--ray", "0,0,4 0,0,-1", "--time", "1.5"]);
    assert_eq!(late.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&late.stderr).contains("06366"));
}

#[test]
fn any_hit_ignores_the_first_triangle_and_takes_the_second() {
    // From z = 10 downwards the triangles lie at t = 8, 9, 10; even primitives are ignored. The
    // triangle (-1, -1), (1, -1), (0, 2) has its centroid at the origin.
    let transcript = told("any-hit", &[]);
    let ray = &transcript["root"]["steps"][0];
    let decisions = ray["decisions"].as_array().unwrap();
    let seen: Vec<_> = decisions
        .iter()
        .map(|one| {
            (one["primitive"].as_u64().unwrap(), one["t"].as_f64().unwrap(), &one["shader"]["exit"]["how"])
        })
        .collect();
    assert_eq!(seen, [(0, 8.0, &json!("ignored")), (1, 9.0, &json!("returned"))]);
    assert_eq!(ray["hit"]["primitive"], 1);
    let barycentrics = &ray["hit"]["attributes"][0]["value"];
    assert_eq!([single(&barycentrics[0]), single(&barycentrics[1])], [1.0 / 3.0; 2]);
    let payload = &ray["payload_after"];
    assert_eq!((member(payload, "seen"), member(payload, "ignored")), (&json!(2), &json!(1)));
    // outputs[0] = vec4(seen, ignored, committed, t)
    let write = &transcript["writes"][0];
    assert_eq!((&write["resource"], &write["member"]), (&json!("outputs"), &json!("outputs[0]")));
    assert_eq!(write["after"]["value"], json!([2.0, 1.0, 1.0, 9.0]));
}

#[test]
fn a_capsule_has_a_side_and_caps_and_a_record_by_arithmetic() {
    // Straight down on the middle: the side at z = 1/2, u = 1/2.
    let ray = &told("capsule", &[])["root"];
    let hit = &ray["hit"];
    assert_eq!(
        (&hit["t"], &hit["surface"], &hit["attributes"][0]["value"]),
        (&json!(3.5), &json!("side"), &json!(0.5))
    );
    assert_eq!(
        ray["record"]["arithmetic"],
        json!({ "instance_offset": 2, "geometry": 0, "stride": 1, "offset": 0 })
    );
    assert_eq!((&ray["record"]["index"], &ray["record"]["name"]), (&json!(2), &json!("capsules")));
    // The second instance's mask is 2, the ray's 1.
    assert_eq!(ray["instances"][1]["verdict"], "masked");
    // Along the axis, at twice the speed: 4 - 2t = 3/2; on a cap u is that of its end.
    let hit = &told("capsule", &["--ray", "cap 1"])["root"]["hit"];
    assert_eq!((&hit["t"], &hit["surface"]), (&json!(1.25), &json!("cap 1")));
    assert_eq!(single(&hit["attributes"][0]["value"]), 1.0);
    // A record that the table lacks: 2 + 0 * 1 + 5 = 7 of 3.
    let ray = &told("capsule", &["--ray", "0,0,4 0,0,-1", "--sbt-offset", "5"])["root"];
    assert_eq!(ray["no_shader"], "the hit table has no record 7, only 3");
}

#[test]
fn an_intersection_shader_reports_twice() {
    // The unit sphere from z = 8: roots 9 (reported first, as kind 6) and 7 (kind 5). Both lie
    // within the interval when reported, so any-hit runs twice.
    let ray = &told("box", &[])["root"];
    let run = &ray["decisions"][0]["shader"];
    let steps: Vec<_> = run["steps"].as_array().unwrap().iter().map(|step| &step["kind"]).collect();
    assert_eq!(steps, ["shader", "report", "shader", "report"]);
    let report =
        |at: usize| (&run["steps"][at]["t"], &run["steps"][at]["hit_kind"], &run["steps"][at]["accepted"]);
    assert_eq!(report(1), (&json!(9.0), &json!(6), &json!(true)));
    assert_eq!(report(3), (&json!(7.0), &json!(5), &json!(true)));
    assert_eq!((&ray["hit"]["t"], &ray["hit"]["hit_kind"]), (&json!(7.0), &json!(5)));
    assert_eq!(member(&ray["payload_after"], "any_hits"), 2);
}

#[test]
fn the_demo_traces_a_shadow_ray_from_a_closest_hit_shader() {
    let output = run(&["--json"]);
    let transcript: Value = serde_json::from_slice(&output.stdout).unwrap();
    let ray = &transcript["root"]["steps"][0];
    assert_eq!(ray["depth"], 1);
    assert!(ray["called_at"]["file"].as_str().unwrap().ends_with("main.rgen"));
    assert!(ray["called_at"]["text"].as_str().unwrap().starts_with("traceRayEXT("));
    let shadow = &ray["shader"]["steps"][0];
    assert_eq!((&shadow["depth"], &shadow["miss_index"]), (&json!(2), &json!(1)));
    assert_eq!(shadow["flags"]["names"], json!(["TerminateOnFirstHitKHR", "SkipClosestHitShaderKHR"]));
    assert_eq!(transcript["writes"][0]["at"], json!({ "texel": [470, 220, 0] }));
}

/// The text of its lines is part of the program, too.
#[test]
fn the_demo_is_explained_alike_in_any_folder() {
    let page = |folder: &Path| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
        let output = command.arg("trace-one-ray").current_dir(folder).output().unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stdout).unwrap()
    };
    let empty = tempfile::tempdir().expect("a folder");
    let page_there = page(empty.path());
    assert!(!page_there.contains('\u{1b}'), "no colour where no terminal is");
    assert!(page_there.contains("vec3 p0 = gl_HitLSSPositionsNV[0];"), "{page_there}");
    assert_eq!(page_there, page(Path::new(env!("CARGO_MANIFEST_DIR"))));
}

#[test]
fn a_trap_is_told_with_its_line_and_ends_with_code_3() {
    let output = run(&["tests/debugger/trace-one-ray/trap.toml", "--pixel", "5,0"]);
    assert_eq!(output.status.code(), Some(3));
    let (stdout, stderr) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(stdout.contains("TRAPPED: a buffer is accessed outside its range at "), "{stdout}");
    assert!(stderr.contains("main.rgen:11"), "{stderr}");
    assert!(stderr.contains("^^^"), "{stderr}");
    let transcript = told("trap", &["--pixel", "5,0"]);
    let exit = &transcript["root"]["exit"];
    assert_eq!((&exit["how"], &exit["at"]["line"]), (&json!("trapped"), &json!(11)));
    assert_eq!(transcript["trap"]["message"], "a buffer is accessed outside its range");
    // Its neighbour is well: 2 * 5 from inputs[4].
    let transcript = told("trap", &["--pixel", "4,0"]);
    assert_eq!(
        (&transcript["writes"][0]["member"], &transcript["writes"][0]["after"]["value"]),
        (&json!("outputs[4]"), &json!(10.0))
    );
}

#[test]
fn what_makes_no_sense_is_answered_with_code_2() {
    const SPHERE: &str = "tests/debugger/trace-one-ray/sphere.toml";
    const CAPSULE: &str = "tests/debugger/trace-one-ray/capsule.toml";
    let cases: [(&[&str], &str); 12] = [
        (&[SPHERE, "--pixel", "2,0"], "pixel 2,0 is outside the launch of 2 x 2 x 1"),
        (&[SPHERE, "--pixel", "-1,0"], "`-1` is not a non-negative integer"),
        (&[SPHERE, "--pixel", "1"], "expected 2 numbers, found 1"),
        (&[SPHERE, "--ray", "0,0,4 0,zero,-1"], "number 5 (direction y) is `zero`"),
        (&[SPHERE, "--ray", "0,0,4 0,0,0"], "the direction is zero"),
        (&[SPHERE, "--ray", "0,0,inf 0,0,1"], "number 3 (origin z) is inf"),
        (&[SPHERE, "--ray", "sideways"], "the scene's named rays: \"head-on\", \"beside\""),
        (&[SPHERE, "--ray", "0,0,4 0,0,-1", "--t-min", "-1"], "must start at 0 or later"),
        (&[SPHERE, "--ray", "0,0,4 0,0,-1", "--flags", "Opaque|NoOpaque"], "exclude each other"),
        (&[SPHERE, "--ray", "0,0,4 0,0,-1", "--flags", "Shiny"], "`Shiny` is not a ray flag"),
        (&[CAPSULE, "--pixel", "0,0"], "no ray generation shader"),
        (&["tests/debugger/trace-one-ray/nowhere.toml"], "nowhere.toml"),
    ];
    for (arguments, words) in cases {
        let output = run(arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(words), "{arguments:?}: {stderr}");
        assert_eq!(String::from_utf8_lossy(&output.stdout), "", "{arguments:?}");
    }
    // Negative numbers are no options.
    assert!(run(&[SPHERE, "--ray", "-0.5,0,4 -0,-0,-1"]).status.success());
}

/// The ray goes straight down where a line lies on a road: both are hit at t = 1.
#[test]
fn a_single_ray_runs_with_many_seeds() {
    let scene = "shaders/many-seeds/tie-order/scene.toml";
    let found = |arguments: &[&str]| {
        let output = run(&[&[scene, "--many-seeds", "8"], arguments].concat());
        (String::from_utf8(output.stdout).expect("UTF-8"), output.status.code())
    };
    let ray = "1.25,1,0.25 0,-1,0";
    let (text, code) = found(&["--ray", ray]);
    assert_eq!(code, Some(6), "{text}");
    assert!(text.contains("error[tie-order]: hit.instance is "), "{text}");
    assert!(text.contains(&format!("anyhit trace-one-ray {scene} --ray \"{ray}\" --seed-range ")), "{text}");
    // Beside the line there is only the road.
    let (text, code) = found(&["--ray", "4,1,0.25 0,-1,0"]);
    assert_eq!(code, Some(0), "{text}");
    let (text, code) = found(&["--pixel", "0,0", "--allow", "tie-order"]);
    assert_eq!(code, Some(0), "{text}");
}

/// Sixteen rays from (i % 4, i / 4, 4) along -z; those at x = 3 pass by the wall at z = 0. Twelve
/// shadow rays begin 0.0001 behind the wall and meet it again.
const SAMPLES: &str = "shaders/pass/testing/samples/scene.toml";

/// What a command prints, which succeeds.
fn page(arguments: &[&str]) -> String {
    let output = run(arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {stderr}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// The transcript of the sixteen rays.
fn samples(arguments: &[&str]) -> Value {
    serde_json::from_str(&page(&[&[SAMPLES, "--json"], arguments].concat())).expect("JSON")
}

/// A line of a shader run.
fn executed(run: &Value, line: u64) -> &Value {
    let lines = run["lines"].as_array().expect("lines");
    lines.iter().find(|one| one["line"] == line).unwrap_or_else(|| panic!("no line {line} in {lines:?}"))
}

/// The variable that a line set.
fn set<'a>(run: &'a Value, line: u64, name: &str) -> &'a Value {
    let values = executed(run, line)["values"].as_array().expect("values");
    let found = values.iter().find(|one| one["name"] == name);
    found.unwrap_or_else(|| panic!("no `{name}` at line {line}: {values:?}"))
}

#[test]
fn many_rays_are_a_screen_with_a_line_each() {
    let text = page(&[SAMPLES]);
    assert!(text.lines().count() <= 60, "{text}");
    let words = "16 rays traced at shaders/pass/testing/samples/main.rgen:19: 12 hit, 4 missed";
    assert!(text.contains(words), "{text}");
    let misses = text.lines().filter(|line| line.contains("missed") && line.contains("MissKHR `sky`"));
    assert_eq!(misses.count(), 4, "{text}");
    let summary = page(&[SAMPLES, "--summary"]);
    let squeezed = summary.split_whitespace().collect::<Vec<_>>().join(" ");
    for words in [
        "ray 16 rays: 12 hit, 4 missed",
        "float 0 -> 4",
        "ran 28 rays, shaders: 12 ClosestHitKHR, 4 MissKHR, 1 RayGenerationKHR",
        "printed shadow 0.000000 (and 1 text more)",
    ] {
        assert!(squeezed.contains(words), "{words}: {summary}");
    }
    assert!(text.starts_with(summary.trim_end()), "the page begins with the summary: {text}");
    assert!(page(&[SAMPLES, "--all"]).matches("ray at depth 1, traced at").count() == 16);
}

#[test]
fn lines_tell_what_they_set() {
    // Ray 6 begins at (6 % 4, 6 / 4) = (2, 1).
    let transcript = samples(&["--sample", "6"]);
    let wall = &transcript["root"]["steps"][6]["shader"];
    assert_eq!(set(wall, 16, "at")["last"]["value"], json!([2.0, 1.0, 0.0]));
    assert_eq!(set(wall, 17, "normal")["last"]["value"], json!([0.0, 0.0, -1.0]));
    // TerminateOnFirstHitKHR 4, SkipClosestHitShaderKHR 8.
    assert_eq!(set(wall, 18, "flags")["last"]["value"], json!(12));
    assert_eq!(
        executed(wall, 16)["text"],
        "vec3 at = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;"
    );
    let payload = &set(wall, 25, "payload")["last"];
    assert_eq!((member(payload, "light"), member(payload, "bounces")), (&json!(0.0), &json!(1)));
    // The others were not asked for.
    assert_eq!(transcript["root"]["steps"][5]["shader"]["lines"], Value::Null);
    assert_eq!(samples(&["--locals", "none"])["root"]["steps"][0]["shader"]["lines"], Value::Null);
    // In a loop the first and the last value stand.
    let root = samples(&["--locals", "all"])["root"].clone();
    let origin = set(&root, 17, "origin");
    assert_eq!((&origin["first"]["value"], &origin["count"]), (&json!([0.0, 0.0, 4.0]), &json!(16)));
    assert_eq!(origin["last"]["value"], json!([3.0, 3.0, 4.0]));
    // Its head begins once for each turn and once more; it sets `i` alone.
    let head = executed(&root, 16);
    assert_eq!((&head["count"], head["values"].as_array().map(Vec::len)), (&json!(17), Some(1)));
    // Each fourth ray adds the light of the sky.
    let sum = set(&root, 20, "sum");
    assert_eq!((&sum["first"]["value"], &sum["last"]["value"]), (&json!(0.0), &json!(4.0)));
    let text = page(&[SAMPLES, "--sample", "6"]);
    assert!(text.contains("gl_HitTEXT (RayTmaxKHR)"), "{text}");
    let squeezed = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(squeezed.contains("17 vec3 normal = vec3(0.0, 0.0, -1.0); normal = vec3(0, 0, -1)"), "{text}");
}

#[test]
fn what_is_printed_stands_where_it_was_printed() {
    // Ray 9 hits at (1, 2), where the closest-hit shader prints behind its shadow ray.
    let root = samples(&[])["root"].clone();
    let inner = &root["steps"][9]["shader"]["printed"][0];
    assert_eq!((&inner["text"], &inner["line"]), (&json!("shadow 0.000000"), &json!(22)));
    assert_eq!((&inner["number"], &inner["steps_before"]), (&json!(0), &json!(1)));
    let outer = &root["printed"][0];
    assert_eq!((&outer["text"], &outer["line"]), (&json!("sum 4.000000"), &json!(22)));
    assert_eq!((&outer["number"], &outer["steps_before"]), (&json!(1), &json!(16)));
    let text = page(&[SAMPLES, "--sample", "9"]);
    let words = "printed at shaders/pass/testing/samples/wall.rchit:22, pixel (0, 0), depth 1";
    assert!(text.contains(words), "{text}");
}

/// Each of four invocations prints; the page has the text of the one that is explained, at its
/// line.
#[test]
fn what_a_compute_shader_prints_has_its_line() {
    let scene = "shaders/debugging/printing/scene.toml";
    let told = page(&[scene, "--invocation", "3,0,0", "--json"]);
    let told: Value = serde_json::from_str(&told).expect("JSON");
    let printed = told["root"]["printed"].as_array().expect("texts");
    assert_eq!(printed.len(), 1, "{printed:?}");
    assert_eq!((&printed[0]["text"], &printed[0]["line"]), (&json!("the square of 3 is 9"), &json!(12)));
    let text = page(&[scene, "--invocation", "3,0,0"]);
    assert!(text.contains("printed at shaders/debugging/printing/main.comp:12"), "{text}");
}

#[test]
fn filters_show_parts_of_the_page() {
    let shadows = page(&[SAMPLES, "--depth", "2"]);
    assert_eq!(shadows.lines().filter(|line| line.starts_with("ray at depth 2,")).count(), 12, "{shadows}");
    let path = "in RayGenerationKHR `raygen` > ray at depth 1 (number 0) > ClosestHitKHR `wall`:";
    assert!(shadows.contains(path), "{shadows}");
    let sky = page(&[SAMPLES, "--shader", "sky"]);
    assert_eq!(sky.lines().filter(|line| line.starts_with("MissKHR `sky`")).count(), 4, "{sky}");
    let normals = page(&[SAMPLES, "--at", "wall.rchit:17"]);
    assert_eq!(normals.matches("normal = vec3(0, 0, -1)").count(), 12, "{normals}");
    let one = page(&[SAMPLES, "--sample", "2"]);
    assert!(one.contains("origin     (2, 0, 4)") && !one.contains("(number 3)"), "{one}");
    let both = page(&[SAMPLES, "--sample", "2", "--depth", "2"]);
    assert_eq!(both.matches("ray at depth 2,").count(), 1, "{both}");
    for (arguments, words) in [
        (&["--sample", "16"][..], "ray 16 does not exist: the outermost shader traces 16"),
        (&["--depth", "3"], "the deepest ray is at depth 2"),
        (&["--shader", "nobody"], "ClosestHitKHR `wall`"),
        (&["--at", "wall.rchit"], "expected FILE:LINE"),
    ] {
        let output = run(&[&[SAMPLES], arguments].concat());
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && error.contains(words), "{words}: {error}");
    }
}

/// The texts of the hints of a kind.
fn hints(transcript: &Value, kind: &str) -> Vec<String> {
    let all = transcript["hints"].as_array().expect("hints").iter().filter(|hint| hint["kind"] == kind);
    all.map(|hint| hint["text"].as_str().expect("text").to_owned()).collect()
}

#[test]
fn hints_tell_known_patterns() {
    let all = samples(&["--locals", "all"]);
    let own = hints(&all, "self_intersection");
    assert_eq!(own.len(), 1, "{own:?}");
    assert!(own[0].contains("instance 0 `wall`, primitive 0") && own[0].contains("at t 1e-4,"), "{own:?}");
    assert!(own[0].ends_with("(12 times)"), "{own:?}");
    assert!(hints(&all, "starts_on_surface").is_empty());
    assert!(hints(&all, "normal_along_ray")[0].contains("`normal`"));
    // (scene, arguments, kind, words): the facts are those of the scenes' comments.
    let cases: [(&str, &[&str], &str, &str); 8] = [
        ("sphere", &["--ray", "0,0,4 0,0,-1", "--cull-mask", "0x100"], "empty_cull_mask", "0x100"),
        // The ball's mask is 6.
        ("sphere", &["--ray", "0,0,4 0,0,-1", "--cull-mask", "1"], "all_masked", "0x06"),
        ("capsule", &["--ray", "0,0,4 0,0,-1", "--sbt-offset", "5"], "no_record", "the table has 3"),
        // At twice the speed t is 1.5, and the way is 3.
        ("sphere", &["--ray", "0,0,4 0,0,-2"], "direction_length", "t 1.5 is a distance of about 3,"),
        // Triangles that are not opaque, at t 8, 9 and 10; the first is ignored.
        (
            "any-hit",
            &["--ray", "0,0,10 0,0,-1", "--flags", "CullNoOpaqueKHR"],
            "all_culled",
            "CullNoOpaqueKHR",
        ),
        ("any-hit", &["--ray", "0,0,10 0,0,-1", "--t-max", "8.5"], "all_ignored", "its 1 candidate"),
        (
            "any-hit",
            &["--ray", "0,0,10 0,0,-1", "--t-min", "8.125", "--t-max", "8.5"],
            "only_outside_interval",
            "the nearest is at t 8",
        ),
        ("sphere", &["--ray", "beside"], "no_hint", ""),
    ];
    for (scene, arguments, kind, words) in cases {
        let transcript = told(scene, arguments);
        let found = hints(&transcript, kind);
        assert_eq!(found.len(), usize::from(kind != "no_hint"), "{kind}: {}", transcript["hints"]);
        assert!(found.iter().all(|hint| hint.contains(words)), "{words}: {found:?}");
    }
    assert_eq!(told("sphere", &["--ray", "head-on"])["hints"], json!([]));
}

/// `shaders/debugging/hints` has a pattern at each even pixel and its twin at the odd one: a ray
/// from (1, 0, 1e-7), where the one before hit the wall in z = 0, with a tMin of 0 or of 0.001; the
/// root of -1 or of 4.
#[test]
fn hints_tell_patterns_and_not_their_twins() {
    let found = |scene: &str, pixel: usize, kind: &str| {
        let scene = format!("shaders/debugging/hints/{scene}.toml");
        let output = run(&[&scene, "--pixel", &format!("{pixel},0"), "--json", "--locals", "all"]);
        hints(&serde_json::from_slice(&output.stdout).expect("JSON"), kind)
    };
    let patterns = [
        ("starts_on_surface", "instance 0 `wall`, primitive 0, with tMin 0"),
        ("nan_written", "a NaN is written to `outputs`"),
    ];
    for (number, (kind, words)) in patterns.into_iter().enumerate() {
        let shown = found("scene", 2 * number, kind);
        assert!(shown.iter().any(|hint| hint.contains(words)), "{kind}: {shown:?}");
        assert!(found("scene", 2 * number + 1, kind).is_empty(), "{kind}");
    }
    let nan = found("scene", 2, "nan_written");
    assert!(
        nan.iter().any(|hint| hint.ends_with("becomes NaN at shaders/debugging/hints/main.rgen:24")),
        "{nan:?}"
    );
    let empty = found("empty", 4, "empty_structure");
    assert!(
        empty.len() == 1 && empty[0].ends_with("the acceleration structure has no instances"),
        "{empty:?}"
    );
    assert!(found("scene", 4, "empty_structure").is_empty());
}

#[test]
fn two_runs_are_compared_to_where_they_part() {
    const SPHERE: &str = "tests/debugger/trace-one-ray/sphere.toml";
    // The sphere is the same on both sides of x = 0.
    let text = page(&[SPHERE, "--pixel", "1,0", "--compare", "pixel=0,0"]);
    for words in ["LaunchIdKHR:", "A  uvec3(1, 0, 0)", "B  uvec3(0, 0, 0)", "the runs do not diverge"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let saved = folder.path().join("before.json");
    std::fs::write(&saved, page(&[SAMPLES, "--json", "--locals", "all"])).expect("a file");
    let saved = saved.to_str().expect("UTF-8");
    let same = page(&[SAMPLES, "--compare", saved]);
    assert!(same.contains("no difference"), "{same}");
    // Where the wall ends at x = 1.5, the ray at x = 2 is the first that misses it.
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).display().to_string();
    let scene = std::fs::read_to_string(Path::new(&root).join(SAMPLES)).expect("the scene");
    let scene = scene.replace("2.5, ", "1.5, ").replace("../../../..", &root);
    let narrow = folder.path().join("narrow.toml");
    std::fs::write(&narrow, scene).expect("a file");
    let parted = page(&[narrow.to_str().expect("UTF-8"), "--compare", saved]);
    let (_, way) = parted.split_once("the first divergence").expect(&parted);
    for words in
        ["ray at depth 1 (number 2)", "main.rgen:19", "primitive 0, verdict:", "A  missed", "B  opaque"]
    {
        assert!(way.contains(words), "{words}: {parted}");
    }
    for (other, words) in [
        ("pixel=9,9", "is outside the launch"),
        ("precision=good", "`good` is not a precision"),
        ("nowhere.json", "nowhere.json"),
        ("nowhere.toml", "nowhere.toml"),
    ] {
        let output = run(&[SPHERE, "--pixel", "1,0", "--compare", other]);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && error.contains(words), "{words}: {error}");
    }
}

#[test]
fn a_ray_is_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let (svg, png, obj) = (file("ray.svg"), file("ray.png"), file("ray.obj"));
    page(&[SAMPLES, "--sample", "6", "--draw", &svg, "--obj", &obj]);
    page(&[SAMPLES, "--sample", "6", "--draw", &png]);
    let svg = std::fs::read_to_string(svg).expect("the picture");
    assert!(svg.contains(">instance 0 `wall`</text>") && svg.contains("t 4</text>"), "{svg}");
    let png = std::fs::read(png).expect("the picture");
    assert!(png.starts_with(b"\x89PNG"));
    let obj = std::fs::read_to_string(obj).expect("the objects");
    // From (2, 1, 4) to the wall at z = 0; the triangle's vertices are the scene's.
    assert!(obj.contains("g ray_0_hit\nv 2 1 4\nv 2 1 0\n"), "{obj}");
    assert!(obj.contains("v 2.5 -20 0\nv 2.5 20 0\nv -40 0 0\nf "), "{obj}");
    let output = run(&[SAMPLES, "--draw", "ray.gif"]);
    assert_eq!(output.status.code(), Some(2));
}
