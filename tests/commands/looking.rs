//! `anyhit render` with `--heat`, `--profile` and `--html`: counts that are derived by hand from
//! SPIR-V or that another command tells, the structure of pages, pages in a browser, and mistakes.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use anyhit_cases::pixel_cost::profile::Profile;
use anyhit_cases::pixel_cost::{HeatMeasure, LaunchCost, PixelCost, measure};
use anyhit_cases::stability::deep_copy;
use anyhit_cases::stability::shadow::texel_errors;
use anyhit_debugger::Session;
use anyhit_scene::{LoadOptions, ResolvedScene, SceneFiles, load};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use crate::support::skipped::{skipped, test_name};

/// A row of 64 pixels in subgroups of 32; the first eight run one block more.
const ROW: &str = "shaders/pass/looking/half-subgroup/scene.toml";
const LEAVES: &str = "shaders/pass/testing/leaves/leaves.toml";
const DEMO: &str = "scenes/swept-spheres.toml";

pub(super) fn anyhit(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().expect("the program starts")
}

/// What a command prints that ends well.
pub(super) fn printed(arguments: &[&str]) -> String {
    let output = anyhit(arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {error}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// What a command says that ends with an error.
pub(super) fn refused(arguments: &[&str], code: i32) -> String {
    let output = anyhit(arguments);
    let error = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {error}");
    error
}

/// A path for a file of a test's own, which is not there.
pub(super) fn file(name: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("looking");
    std::fs::create_dir_all(&folder).expect("a writable folder");
    let path = folder.join(name);
    let _ = std::fs::remove_file(&path);
    path.to_str().expect("UTF-8").to_owned()
}

pub(super) fn loaded(scene: &str, size: Option<[u32; 2]>) -> ResolvedScene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
    let options = LoadOptions { size, ..LoadOptions::default() };
    load(&path, &SceneFiles::default(), &options).expect("a scene")
}

pub(super) fn session(scene: &str, size: Option<[u32; 2]>) -> Session {
    Session::new(loaded(scene, size)).expect("shaders")
}

pub(super) fn cost(session: &Session) -> LaunchCost {
    let run = deep_copy(session.assembled());
    let single = session.assembled().single_pass(None).expect("a pass");
    measure(session.assembled(), &single, &run.resources).expect("a run")
}

#[test]
fn instructions_are_those_of_the_module_and_divergence_is_of_subgroups() {
    // Of `main.rgen.spv` as `spirv-dis` shows it, labels aside: 24 instructions up to the branch, 3
    // in the block that eight pixels run, 7 behind it. In their subgroup those 3 run in 8 of 32
    // lanes; the other subgroup skips them as a whole.
    let found = cost(&session(ROW, None)).pixels;
    let pixel = |instructions, divergent| PixelCost { instructions, divergent, ..PixelCost::default() };
    let mut expected = vec![pixel(24 + 3 + 7, 3); 8];
    expected.resize(64, pixel(24 + 7, 0));
    assert_eq!(found, expected);
}

#[test]
fn a_subgroup_that_takes_a_branch_as_a_whole_does_not_diverge() {
    for subgroup_size in [1, 8] {
        let mut scene = loaded(ROW, None);
        scene.pipeline.subgroup_size = Some(subgroup_size);
        let session = Session::new(scene).expect("shaders");
        let cost = cost(&session);
        assert_eq!(cost.subgroup_size, Some(subgroup_size));
        assert!(cost.pixels.iter().all(|pixel| pixel.divergent == 0));
        assert_eq!(cost.pixels[7].instructions, 34);
    }
    // Of 16 pixels eight run the block.
    let mut scene = loaded(ROW, None);
    scene.pipeline.subgroup_size = Some(16);
    let cost = cost(&Session::new(scene).expect("shaders"));
    let divergent: Vec<u64> = cost.pixels.iter().map(|pixel| pixel.divergent).collect();
    assert_eq!((divergent[..8].to_vec(), divergent[8..].iter().sum()), (vec![3; 8], 0));
}

#[test]
fn errors_are_counted_in_ulps_of_the_number_that_f64_gives() {
    // Pixel x writes (2^24 + x) - 2^24. From 2^24 to 2^25 floats are the even numbers: an odd x is
    // off by 1, which is 2^23 ulps of numbers from 1 to 2, 2^22 of those up to 4, and so on.
    let session = session(ROW, None);
    let single = session.assembled().single_pass(None).expect("a pass");
    let (size, errors) = texel_errors(session.scene(), session.assembled(), &single).expect("a run");
    assert_eq!(size, [64, 1, 1]);
    let exponent = |x: usize| usize::BITS - 1 - x.leading_zeros();
    let expected: Vec<f64> =
        (0..64).map(|x| if x % 2 == 0 { 0.0 } else { f64::from(1_u32 << (23 - exponent(x))) }).collect();
    assert_eq!(errors, expected);
}

#[test]
fn any_hit_shaders_are_counted_for_each_pixel() {
    // x = 0 goes through the hole and the leaf behind it, x = 1 meets one leaf, x = 2 the sky: so
    // scene.toml derives it.
    let pixels = cost(&session(LEAVES, None)).pixels;
    assert_eq!(pixels.iter().map(|pixel| pixel.any_hit).collect::<Vec<_>>(), [2, 1, 0]);
}

/// Adds up all numbers under a key.
pub(super) fn sum_of(value: &Value, key: &str) -> u64 {
    match value {
        Value::Object(members) => members
            .iter()
            .map(|(name, value)| if name == key { value.as_u64().unwrap_or(0) } else { sum_of(value, key) })
            .sum(),
        Value::Array(values) => values.iter().map(|value| sum_of(value, key)).sum(),
        _ => 0,
    }
}

#[test]
fn nodes_and_primitives_are_those_that_the_explanation_of_the_pixel_tells() {
    let out = file("nodes.png");
    let told = printed(&["render", DEMO, "--size", "96x54", "--heat", "nodes", "--json", "-o", &out]);
    let told: Value = serde_json::from_str(&told).expect("JSON");
    let worst = told["worst"].as_array().expect("an array");
    assert_eq!(worst.len(), 16);
    let cost = cost(&session(DEMO, Some([96, 54])));
    for pixel in worst.iter().step_by(5) {
        let command = pixel["command"].as_str().expect("a command");
        let words: Vec<&str> = command.split(' ').skip(1).collect();
        let explained = printed(&[&words[..], &["--json"]].concat());
        let explained: Value = serde_json::from_str(&explained).expect("JSON");
        assert_eq!(pixel["value"].as_f64(), Some(sum_of(&explained, "nodes") as f64), "{command}");
        let [x, y] = [0, 1].map(|axis| pixel["pixel"][axis].as_u64().expect("a number") as usize);
        let tested = count_of(&explained, "tested");
        assert_eq!(cost.pixels[y * 96 + x].primitives, tested, "{command}");
    }
}

/// Adds up the lengths of all arrays under a key.
pub(super) fn count_of(value: &Value, key: &str) -> u64 {
    match value {
        Value::Object(members) => members
            .iter()
            .map(|(name, value)| match value.as_array() {
                Some(items) if name == key => items.len() as u64,
                _ => count_of(value, key),
            })
            .sum(),
        Value::Array(values) => values.iter().map(|value| count_of(value, key)).sum(),
        _ => 0,
    }
}

#[test]
fn a_heat_map_is_told_with_its_numbers() {
    let out = file("instructions.png");
    let told = printed(&["render", ROW, "--heat", "instructions", "-o", &out]);
    let command = format!("anyhit trace-one-ray {ROW} --pixel");
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(
        lines[..6],
        [
            "SPIR-V instructions per pixel, 64 x 1 pixels",
            "  total 2,008, mean 31.4",
            "  min 31, median 31, 90 % 34, 99 % 34, max 34",
            "worst pixels:",
            &format!("  34  {command} 0,0"),
            &format!("  34  {command} 1,0"),
        ],
        "8 times 34 and 56 times 31 are 2008, which is 31.375 times 64"
    );
    let json = printed(&["render", ROW, "--heat", "divergence", "--json", "-o", &out]);
    let json: Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(
        (&json["version"], &json["measure"], &json["size"]),
        (&json!(1), &json!("divergence"), &json!([64, 1]))
    );
    assert_eq!(json["percentiles"]["100"], json!(300.0 / 34.0));
    assert_eq!(json["worst"].as_array().map(Vec::len), Some(8));
    let picture = image::open(&out).expect("a PNG").to_rgba8();
    // 64 pixels are magnified five times, with eight pixels of margin.
    let at = |x: u32| picture.get_pixel(8 + 5 * x + 2, 10).0;
    assert!(at(0) == at(7) && at(8) == at(63) && at(7) != at(8), "{:?} {:?}", at(7), at(8));
}

#[test]
fn the_same_counts_on_one_thread_and_on_many() {
    let heat = |threads: &str| {
        let out = file(&format!("threads-{threads}.png"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
        command.args(["render", DEMO, "--size", "48x27", "--heat", "primitives", "-o", &out]);
        command.env("RAYON_NUM_THREADS", threads).current_dir(env!("CARGO_MANIFEST_DIR"));
        let output = command.output().expect("the program starts");
        (output.stdout, std::fs::read(&out).expect("the heat map"))
    };
    let one = heat("1");
    assert!(!one.0.is_empty());
    assert!(one == heat("4"));
}

#[test]
fn a_profile_has_every_instruction_at_its_line_below_its_callers() {
    let session = session(DEMO, Some([96, 54]));
    let cost = cost(&session);
    let single = session.assembled().single_pass(None).expect("a launch");
    let profile = Profile::of_pass(session.scene(), &single, &cost.calls).expect("a profile");
    let all: u64 = cost.pixels.iter().map(|pixel| pixel.instructions).sum();
    assert_eq!(profile.total(), all);

    // The line of ray generation that traces, as the source says.
    let source = std::fs::read_to_string("shaders/demo/swept-spheres/main.rgen").expect("the source");
    let line = source.lines().position(|line| line.contains("traceRayEXT")).expect("a trace") + 1;
    let caller = format!("main.rgen:{line}");
    let mut stages: BTreeMap<&str, u64> = BTreeMap::new();
    for (stack, count) in &profile.stacks {
        // A shader has a frame above those of its lines, below the line that traces.
        let frames: Vec<&str> = stack.split(';').collect();
        let is_shader = |frame: &str| frame.contains("KHR ");
        let shaders: Vec<usize> = (0..frames.len()).filter(|&at| is_shader(frames[at])).collect();
        assert!(shaders[0] == 0 && frames[0].starts_with("RayGenerationKHR "), "{stack}");
        let inner = match shaders[..] {
            [_] => 0,
            [_, called, ..] => {
                assert_eq!((called, frames[1]), (2, caller.as_str()), "{stack}");
                called
            }
            _ => panic!("{stack}"),
        };
        *stages.entry(frames[inner].split(' ').next().expect("a stage")).or_default() += count;
    }
    assert!(stages.keys().eq(["ClosestHitKHR", "MissKHR", "RayGenerationKHR"].iter()), "{stages:?}");
    // Every pixel runs the straight line of ray generation once.
    assert_eq!(stages["RayGenerationKHR"] % (96 * 54), 0);

    let out = file("demo.folded");
    printed(&["render", DEMO, "--size", "96x54", "--profile", &out]);
    assert_eq!(std::fs::read_to_string(&out).expect("the profile"), profile.folded());
}

#[test]
fn a_profile_without_debug_information_names_modules() {
    let out = file("row.folded");
    printed(&["render", ROW, "--profile", &out]);
    let folded = std::fs::read_to_string(&out).expect("the profile");
    assert_eq!(folded, "RayGenerationKHR main.rgen.spv 2008\n");
}

#[test]
fn a_flame_graph_is_drawn_or_the_missing_feature_named() {
    let out = file("row.svg");
    if cfg!(feature = "flamegraph") {
        printed(&["render", ROW, "--profile", &out]);
        let svg = std::fs::read_to_string(&out).expect("the flame graph");
        assert!(svg.contains("<svg") && svg.contains("RayGenerationKHR main.rgen.spv"), "{svg}");
    } else {
        let error = refused(&["render", ROW, "--profile", &out], 4);
        assert!(error.contains("it lacks the feature `flamegraph`"), "{error}");
        assert!(error.contains("--features flamegraph"), "{error}");
    }
}

/// The data of a page.
pub(super) fn data_of(html: &str) -> Value {
    let (_, rest) = html.split_once("<script type=\"application/json\" id=\"data\">").expect("the data");
    serde_json::from_str(rest.split_once("</script>").expect("its end").0).expect("JSON")
}

pub(super) fn inflated(text: &Value) -> Vec<u8> {
    let stream = STANDARD.decode(text.as_str().expect("a text")).expect("Base64");
    let mut bytes = Vec::new();
    flate2::read::ZlibDecoder::new(&stream[..]).read_to_end(&mut bytes).expect("a zlib stream");
    bytes
}

pub(super) fn picture_of(address: &Value) -> image::RgbaImage {
    let bytes = address.as_str().and_then(|text| text.strip_prefix("data:image/png;base64,"));
    let bytes = STANDARD.decode(bytes.expect("the address of a PNG")).expect("Base64");
    image::load_from_memory(&bytes).expect("a PNG").to_rgba8()
}

#[test]
fn a_page_holds_all_that_it_shows() {
    let [page, picture] = [file("row.html"), file("row.png")];
    printed(&["render", ROW, "--html", &page, "-o", &picture]);
    let html = std::fs::read_to_string(&page).expect("the page");
    for word in ["http:", "https:", "src=\"", "href=", "@import", "url(", "innerHTML", "eval("] {
        assert!(!html.contains(word), "{word}");
    }
    assert!(html.contains("default-src 'none'") && html.contains("<html lang=\"en\">"));
    // Every label of the body is for a control inside it, and every id that the script asks for is
    // there.
    for (at, _) in html.match_indices("by(\"") {
        let id = html[at + 4..].split('"').next().expect("an id");
        assert_eq!(html.matches(&format!("id=\"{id}\"")).count(), 1, "{id}");
    }

    let data = data_of(&html);
    assert_eq!(data["extent"], json!([64, 1]));
    let shown = picture_of(&data["pictures"][0]["png"]);
    assert_eq!(shown, image::open(&picture).expect("the picture").to_rgba8());
    let layers = data["layers"].as_array().expect("an array");
    let names: Vec<&Value> = layers.iter().map(|layer| &layer["name"]).collect();
    assert_eq!(names, ["instructions", "nodes", "primitives", "any-hit", "divergence"]);
    let values = inflated(&layers[0]["values"]);
    let values: Vec<f32> = values.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    assert_eq!((values.len(), values[7], values[8]), (64, 34.0, 31.0));
    assert_eq!(picture_of(&layers[0]["png"]).dimensions(), (64, 1));
    assert_eq!(layers[0]["worst"][0], json!([[0, 0], 34.0]));

    let explained = &data["explanations"];
    assert_eq!((&explained["count"], &explained["which"]), (&json!(64), &json!("all pixels")));
    let texts: Vec<String> = serde_json::from_slice(&inflated(&explained["texts"])).expect("JSON");
    assert_eq!(texts.len(), 64);
    for x in [0, 7, 63] {
        assert_eq!(explained["pixels"][x], json!([x, 0]));
        let pixel = format!("{x},0");
        assert_eq!(texts[x], printed(&["trace-one-ray", ROW, "--pixel", &pixel]));
    }
    assert_eq!(data["command"], json!([format!("anyhit trace-one-ray {ROW} --pixel "), ""]));
}

#[test]
fn large_pictures_are_explained_where_it_is_asked_for_and_on_a_grid() {
    let page = file("demo.html");
    printed(&["render", "--size", "96x54", "--html", &page, "--explain", "95,53", "--explain", "1,2"]);
    let data = data_of(&std::fs::read_to_string(&page).expect("the page"));
    let explained = &data["explanations"];
    let pixels = explained["pixels"].as_array().expect("an array");
    assert_eq!(pixels[..2], [json!([95, 53]), json!([1, 2])]);
    let which = explained["which"].as_str().expect("a text");
    assert!(which.starts_with(&format!("{} of 5,184 pixels", pixels.len())), "{which}");
    assert_eq!(data["command"], json!(["anyhit trace-one-ray --pixel ", " --size 96x54"]));
    let texts: Vec<String> = serde_json::from_slice(&inflated(&explained["texts"])).expect("JSON");
    assert_eq!(texts[1], printed(&["trace-one-ray", "--pixel", "1,2", "--size", "96x54"]));
}

#[test]
fn a_page_compares_two_pictures() {
    let [page, other] = [file("compare.html"), file("compare.png")];
    printed(&["render", ROW, "-o", &other]);
    let mut picture = image::open(&other).expect("the picture").to_rgba8();
    picture.get_pixel_mut(40, 0).0[1] ^= 9;
    picture.save(&other).expect("a writable folder");
    printed(&["render", ROW, "--html", &page, "--compare", &other]);
    let data = data_of(&std::fs::read_to_string(&page).expect("the page"));
    let names: Vec<&Value> =
        data["pictures"].as_array().expect("an array").iter().map(|one| &one["name"]).collect();
    assert_eq!(names, ["found", "expected", "difference"]);
    assert_eq!(picture_of(&data["pictures"][1]["png"]), picture);
    let layer = data["layers"].as_array().and_then(|layers| layers.last()).expect("a layer");
    assert_eq!((&layer["name"], &layer["worst"]), (&json!("difference"), &json!([[[40, 0], 9.0]])));
    assert_eq!(layer["facts"], json!(["1 of 64 pixels differ, by at most 9"]));
    assert_eq!(data["selected"], json!([40, 0]));

    let small = file("small.png");
    image::RgbaImage::new(2, 1).save(&small).expect("a writable folder");
    let error = refused(&["render", ROW, "--html", &page, "--compare", &small], 2);
    assert!(error.contains("the picture is 2 x 1, but the rendering is 64 x 1"), "{error}");
    let error = refused(&["render", ROW, "--html", &page, "--compare", "nowhere.png"], 2);
    assert!(error.contains("nowhere.png"), "{error}");
}

#[test]
fn a_failed_picture_has_a_page() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("looking-failed");
    let _ = std::fs::remove_dir_all(&folder);
    let pictures = folder.to_str().expect("UTF-8");
    let output = anyhit(&["test", "tests/commands/test-command/image", "--pictures", pictures]);
    assert_eq!(output.status.code(), Some(1));
    let page = folder.join("tests/commands/test-command/image/picture/page.html");
    let out = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(out.contains(page.to_str().expect("UTF-8")), "{out}");
    let data = data_of(&std::fs::read_to_string(&page).expect("the page"));
    let names: Vec<&Value> =
        data["pictures"].as_array().expect("an array").iter().map(|one| &one["name"]).collect();
    assert_eq!(names, ["found", "expected", "difference"]);
    let title = data["title"].as_str().expect("a text");
    assert_eq!(title, "tests/commands/test-command/image: image `picture` is not as expected");
    assert_eq!(data["explanations"]["pixels"][0], data["selected"]);
}

#[test]
fn mistakes_are_told() {
    let out = file("mistakes.png");
    let error = refused(&["render", ROW, "--heat", "heat"], 2);
    assert!(
        error.contains("[possible values: instructions, nodes, primitives, any-hit, divergence, ulps]"),
        "{error}"
    );
    let error = refused(&["render", ROW, "--heat", "nodes", "-o", "heat.exr"], 2);
    assert!(error.contains("a heat map is a .png file, and `heat.exr` does not end in .png"), "{error}");
    let error = refused(&["render", ROW, "--heat", "nodes", "-o", "no/such/folder/heat.png"], 2);
    assert!(error.contains("no/such/folder"), "{error}");
    let error = refused(&["render", ROW, "--html", "no/such/folder/page.html"], 2);
    assert!(error.contains("no/such/folder"), "{error}");
    let error = refused(&["render", ROW, "--profile", "profile.txt"], 2);
    assert!(
        error.contains("a profile is a .folded or .svg file, and `profile.txt` ends in neither"),
        "{error}"
    );
    let error = refused(&["render", ROW, "--heat", "nodes", "--heat-max", "0", "-o", &out], 2);
    assert!(error.contains("expected a finite number above 0"), "{error}");
    let error = refused(&["render", ROW, "--heat-max", "3"], 2);
    assert!(error.contains("--heat <MEASURE>"), "{error}");
    for other in [&["--sanitize"][..], &["--shadow"], &["--many-seeds", "2"], &["--stats"]] {
        let error = refused(&[&["render", ROW, "--heat", "nodes", "-o", &out], other].concat(), 2);
        assert!(error.contains("`--html` cannot be used with"), "{other:?}: {error}");
    }
    let error = refused(&["render", ROW, "--pass", "0"], 2);
    assert!(error.contains("`--pass` requires --heat"), "{error}");
    let error = refused(&["render", ROW, "--heat", "nodes", "--pass", "7", "-o", &out], 2);
    assert!(error.contains('7'), "{error}");
    for pixel in ["64,0", "0,1"] {
        let error = refused(&["render", ROW, "--html", &file("never.html"), "--explain", pixel], 2);
        assert!(error.contains("is outside the picture") && error.contains("from 0,0 to 63,0"), "{error}");
    }
    let error = refused(&["render", ROW, "--html", &file("never.html"), "--explain", "a"], 2);
    assert!(error.contains("`--explain a` is not X,Y"), "{error}");
    let error = refused(&["render", ROW, "--json", "--profile", &file("never.folded")], 2);
    assert!(error.contains("`--json` requires --heat"), "{error}");
    assert!(!Path::new(&out).exists(), "nothing was written");
}

#[test]
fn what_runs_nothing_has_no_heat() {
    let rays = "tests/debugger/trace-one-ray/capsule.toml";
    let error = refused(&["render", rays, "--heat", "nodes", "-o", &file("never.png")], 2);
    assert!(error.contains("no launch and no dispatch whose invocations can be counted"), "{error}");
}

#[test]
fn the_measures_have_different_names() {
    let mut names = HeatMeasure::ALL.map(HeatMeasure::name).to_vec();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), HeatMeasure::ALL.len());
}

/// The page at an address after its script has run, as the browser prints it.
fn in_browser(browser: &str, address: &str) -> String {
    let profile = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("looking-browser");
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=10000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(address)
        .output()
        .expect("the browser starts");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    text
}

/// The text of the element with an id, as HTML.
fn element<'a>(dom: &'a str, id: &str) -> &'a str {
    let (_, rest) = dom.split_once(&format!("id=\"{id}\"")).unwrap_or_else(|| panic!("{id}"));
    let (_, rest) = rest.split_once('>').expect("the end of a tag");
    rest.split("</").next().expect("a text")
}

#[test]
fn a_browser_shows_the_explanation_of_a_pixel() {
    let known = std::env::var("ANYHIT_CHROMIUM").ok();
    let names = known.as_deref().into_iter().chain(["chromium", "chromium-browser", "google-chrome"]);
    let runs = |name: &&str| {
        Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success())
    };
    let Some(browser) = names.into_iter().find(runs) else {
        skipped(test_name!(), "neither chromium nor google-chrome is installed");
        return;
    };
    let page = file("browser.html");
    let heat = printed(&["render", LEAVES, "--heat", "any-hit", "--html", &page, "-o", &file("browser.png")]);
    let address = |pixel: &str| format!("file://{page}{pixel}");
    let escaped = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");

    let dom = in_browser(browser, &address("#1,0"));
    assert_eq!(element(&dom, "pixel-title"), "Pixel 1,0");
    let explanation = printed(&["trace-one-ray", LEAVES, "--pixel", "1,0"]);
    assert_eq!(element(&dom, "explanation"), escaped(&explanation));
    assert_eq!(element(&dom, "command-text"), format!("anyhit trace-one-ray {LEAVES} --pixel 1,0"));
    let row = |title: &str, value: &str| format!("<th scope=\"row\">{title}</th><td>{value}</td>");
    assert!(dom.contains(&row("any-hit invocations per pixel", "1")), "{dom}");
    // Half of 255 and a quarter of it, as 8-bit numbers are rounded.
    assert!(dom.contains(&row("picture, RGBA", "128 64 255 255")), "{dom}");
    assert_eq!(element(&dom, "legend-title"), "any-hit invocations per pixel");
    assert_eq!(dom.matches("<option value=").count(), 11, "ten sizes, and as wide as there is room");

    // At first the worst pixel of the layer that is shown.
    let dom = in_browser(browser, &address(""));
    let (_, worst) = heat.split_once("--pixel ").expect("a worst pixel");
    let worst = worst.split_whitespace().next().expect("its place");
    assert_eq!(element(&dom, "pixel-title"), format!("Pixel {worst}"));
    // A pixel beyond the picture is the last one.
    let dom = in_browser(browser, &address("#99,99"));
    assert_eq!(element(&dom, "pixel-title"), "Pixel 2,0");
}
