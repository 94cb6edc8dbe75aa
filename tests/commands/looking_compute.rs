//! `--heat`, `--profile` and `--html` of dispatches, by `anyhit run` and `anyhit render`: counts
//! that are derived by hand from SPIR-V or that another command prints, and the structure of pages.

use anyhit_cases::pixel_cost::PixelCost;
use anyhit_cases::stability::shadow::texel_errors;
use serde_json::{Value, json};

use crate::commands::looking::{
    cost, count_of, data_of, file, inflated, picture_of, printed, refused, session, sum_of,
};

/// Two times two workgroups of 8 x 4, and a picture of 13 x 6.
const COMPUTE: &str = "shaders/pass/looking/compute/scene.toml";
const MODULE: &str = "spirv-fixtures/pass/looking/compute/main.wgsl.spv";
const QUERIES: &str = "shaders/pass/ray-query/compute/scene.toml";
const SUMS: &str = "spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";

#[test]
fn instructions_are_those_of_the_module_and_divergence_is_of_workgroups() {
    // Of the module as `spirv-dis` shows it, labels aside: 9 instructions up to the branch of
    // those outside of the picture, whose return is 1; 8 up to the branch of the first four
    // columns, 5 in it, and 6 behind it. A workgroup is one subgroup: in the first one only the 5
    // run in a part of it, in all others invocations are outside and inside.
    let found = cost(&session(COMPUTE, None)).pixels;
    let expected = (0..16 * 8).map(|at| {
        let [x, y] = [at % 16, at / 16];
        let is_first = x < 8 && y < 4;
        let (instructions, divergent) = match (x < 13 && y < 6, x < 4) {
            (false, _) => (9 + 1, 1),
            (true, false) => (9 + 8 + 6, if is_first { 0 } else { 8 + 6 }),
            (true, true) => (9 + 8 + 5 + 6, if is_first { 5 } else { 8 + 5 + 6 }),
        };
        PixelCost { instructions, divergent, ..PixelCost::default() }
    });
    assert_eq!(found, expected.collect::<Vec<_>>());
}

#[test]
fn errors_of_a_dispatch_are_counted_in_ulps() {
    // Column x writes (2^24 + x) - 2^24 in red: as in shaders/pass/looking/half-subgroup, an odd x
    // is off by 1, which is 2^23 ulps of numbers from 1 to 2, 2^22 of those up to 4, and so on.
    let session = session(COMPUTE, None);
    let single = session.assembled().single_pass(None).expect("a pass");
    let (size, errors) = texel_errors(session.scene(), session.assembled(), &single).expect("a run");
    assert_eq!(size, [16, 8, 1]);
    let exponent = |x: usize| usize::BITS - 1 - x.leading_zeros();
    let expected = (0..16 * 8).map(|at| match (at % 16, at / 16) {
        (x @ 0..13, 0..6) if x % 2 == 1 => f64::from(1_u32 << (23 - exponent(x))),
        _ => 0.0,
    });
    assert_eq!(errors, expected.collect::<Vec<_>>());
}

#[test]
fn nodes_and_primitives_are_those_that_the_explanation_of_the_invocation_has() {
    // Two workgroups of 16 x 4; pass 1 is the shader from WGSL.
    let out = file("compute-primitives.png");
    let found = printed(&["run", QUERIES, "--heat", "primitives", "--pass", "1", "--json", "-o", &out]);
    let found: Value = serde_json::from_str(&found).expect("JSON");
    assert_eq!((&found["size"], &found["invocations"]), (&json!([16, 8]), &json!([16, 8, 1])));
    let worst = found["worst"].as_array().expect("an array");
    assert_eq!(worst.len(), 16);
    let cost = cost(&session(QUERIES, None));
    for one in worst.iter().step_by(5) {
        let id = [0, 1, 2].map(|axis| one["invocation"][axis].as_u64().expect("a number"));
        let command = one["command"].as_str().expect("a command");
        let expected = format!("--invocation {},{},{} --pass 1", id[0], id[1], id[2]);
        assert_eq!(command, format!("anyhit trace-one-ray {QUERIES} {expected}"));
        let words: Vec<&str> = command.split(' ').skip(1).collect();
        let explained = printed(&[&words[..], &["--json"]].concat());
        let explained: Value = serde_json::from_str(&explained).expect("JSON");
        let [nodes, primitives] = [sum_of(&explained, "nodes"), count_of(&explained, "tested")];
        assert_eq!((one["value"].as_f64(), primitives), (Some(primitives as f64), 1), "{command}");
        // Both shaders trace the same rays, and by default the first dispatch is measured.
        let [x, y, _] = id.map(|axis| axis as usize);
        let pixel = cost.pixels[y * 16 + x];
        assert_eq!((pixel.nodes, pixel.primitives), (nodes, primitives), "{command}");
    }
}

#[test]
fn render_and_run_measure_the_same() {
    let [one, other] = ["render", "run"].map(|command| {
        let out = file(&format!("compute-{command}.png"));
        let text = printed(&[command, COMPUTE, "--heat", "instructions", "-o", &out]);
        (text, std::fs::read(&out).expect("the heat map"))
    });
    assert!(one.0.starts_with("SPIR-V instructions per invocation, 16 x 8 x 1 invocations\n"), "{}", one.0);
    assert!(one == other);
}

#[test]
fn a_page_of_a_dispatch_shows_the_invocations_of_its_picture() {
    let [page, picture] = [file("compute.html"), file("compute-picture.png")];
    printed(&["run", COMPUTE, "--html", &page, "--explain", "12,5,0"]);
    printed(&["render", COMPUTE, "-o", &picture]);
    let data = data_of(&std::fs::read_to_string(&page).expect("the page"));
    assert_eq!(data["extent"], json!([13, 6]));
    let invocations = json!({ "word": "invocation", "size": [16, 8, 1], "stride": 16, "dimensions": 3 });
    assert_eq!(data["invocations"], invocations);
    let shown = picture_of(&data["pictures"][0]["png"]);
    assert_eq!(shown, image::open(&picture).expect("the picture").to_rgba8());
    assert_eq!(data["selected"], json!([12, 5]));

    // Float by float as the expectation of the scene has them, in planes of bytes.
    let floats = &data["pictures"][0]["floats"];
    assert_eq!((&floats["channels"], &data["pictures"][0]["encoding"]), (&json!(4), &json!("stored")));
    let bytes = inflated(&floats["values"]);
    let count = bytes.len() / 4;
    assert_eq!(count, 13 * 6 * 4);
    let number = |at: usize| f32::from_le_bytes([0, 1, 2, 3].map(|byte| bytes[byte * count + at]));
    let texel = |x: usize, y: usize| [0, 1, 2, 3].map(|channel| number(4 * (13 * y + x) + channel));
    assert_eq!((texel(3, 5), texel(4, 5)), ([4.0, 1.25, 0.0, 1.0], [4.0, 0.0, 0.0, 1.0]));

    // No ray, no any-hit shader: what is 0 everywhere is no layer.
    let layers = data["layers"].as_array().expect("an array");
    let names: Vec<&Value> = layers.iter().map(|layer| &layer["name"]).collect();
    assert_eq!(names, ["instructions", "divergence"]);
    assert_eq!(layers[0]["title"], "SPIR-V instructions per invocation");
    let values = inflated(&layers[0]["values"]);
    let values: Vec<f32> = values.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    let counted = cost(&session(COMPUTE, None)).pixels;
    let expected = (0..6).flat_map(|y| (0..13).map(move |x| 16 * y + x));
    assert_eq!(values, expected.map(|at| counted[at].instructions as f32).collect::<Vec<_>>());

    let explained = &data["explanations"];
    assert_eq!(explained["which"], "all invocations");
    let texts: Vec<String> = serde_json::from_slice(&inflated(&explained["texts"])).expect("JSON");
    assert_eq!(texts.len(), 13 * 6);
    assert_eq!(texts[5 * 13 + 12], printed(&["trace-one-ray", COMPUTE, "--invocation", "12,5,0"]));
    let command = json!([format!("anyhit trace-one-ray {COMPUTE} --invocation "), ""]);
    assert_eq!(data["command"], command);
}

#[test]
fn explanations_of_a_later_pass_are_its_own() {
    let page = file("queries.html");
    printed(&["run", QUERIES, "--html", &page, "--pass", "1"]);
    let data = data_of(&std::fs::read_to_string(&page).expect("the page"));
    let texts: Vec<String> = serde_json::from_slice(&inflated(&data["explanations"]["texts"])).expect("JSON");
    assert_eq!(texts.len(), 16 * 8);
    // The second shader writes its sums behind those of the first one, as the scene expects them.
    let alone = printed(&["trace-one-ray", QUERIES, "--invocation", "0,0,0", "--pass", "1"]);
    assert!(alone.contains("[2]  uint 0 -> 54"), "{alone}");
    assert_eq!(texts[0], alone);
}

#[test]
fn a_module_without_an_image_has_heat_maps_alone() {
    let page = file("module.html");
    printed(&["run", SUMS, "--groups", "2", "--html", &page]);
    let data = data_of(&std::fs::read_to_string(&page).expect("the page"));
    // Two workgroups of 256, in rows of an eighth of one.
    assert_eq!((&data["extent"], &data["pictures"]), (&json!([32, 16]), &json!([])));
    assert_eq!(data["command"], Value::Null);
    assert_eq!(data["facts"][1], "no picture: the scene has no output image");
    let out = file("module.png");
    let text = printed(&["run", SUMS, "--groups", "2", "--heat", "instructions", "-o", &out]);
    let worst = text.lines().find(|line| line.contains("  invocation ")).expect("an invocation");
    assert!(worst.trim_start().starts_with(|c: char| c.is_ascii_digit()), "{text}");
    // A module's image has a texel for each invocation.
    printed(&["run", MODULE, "--groups", "2,2", "--html", &page]);
    let data = data_of(&std::fs::read_to_string(&page).expect("the page"));
    assert_eq!(data["pictures"][0]["name"], "picture");
    assert_eq!(data["extent"], json!([16, 8]));
}

#[test]
fn a_profile_of_a_dispatch_has_all_of_its_instructions() {
    let out = file("compute.folded");
    printed(&["run", QUERIES, "--profile", &out]);
    let folded = std::fs::read_to_string(&out).expect("the profile");
    let counted: u64 = cost(&session(QUERIES, None)).pixels.iter().map(|pixel| pixel.instructions).sum();
    let sum = folded.lines().map(|line| line.rsplit(' ').next().and_then(|count| count.parse::<u64>().ok()));
    assert_eq!(sum.sum::<Option<u64>>(), Some(counted), "{folded}");
    assert!(folded.lines().all(|line| line.starts_with("GLCompute main.comp")), "{folded}");
}

#[test]
fn mistakes_are_reported() {
    let page = file("never.html");
    let error = refused(&["run", COMPUTE, "--html", &page, "--explain", "13,0,0"], 2);
    assert!(error.contains("is outside the picture"), "{error}");
    assert!(error.contains("invocations range from 0,0,0 to 12,5,0"), "{error}");
    let error = refused(&["run", SUMS, "--html", &page, "--compare", "a.png"], 2);
    assert!(error.contains("the scene has no output image"), "{error}");
    for other in [&["--dump", "picture"][..], &["--stats"], &["--sanitize"], &["--shadow"]] {
        let error = refused(&[&["run", COMPUTE, "--html", &page], other].concat(), 2);
        assert!(error.contains("`--html` cannot be used with"), "{other:?}: {error}");
    }
    let error = refused(&["run", COMPUTE, "--json", "--html", &page], 2);
    assert!(error.contains("`--json` requires --heat"), "{error}");
    let error = refused(&["run", COMPUTE, "-o", "heat.png"], 2);
    assert!(error.contains("--heat <MEASURE>"), "{error}");
    let wide = "shaders/pass/subgroups/wide/scene.toml";
    let error = refused(&["run", wide, "--heat", "nodes", "-o", &file("never.png")], 4);
    assert!(error.contains("in subgroups of more than 64 invocations"), "{error}");
    assert!(!std::path::Path::new(&page).exists(), "nothing was written");
}
