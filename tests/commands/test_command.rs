//! `anyhit test` from the outside: what passes, what each kind of failed expectation looks like,
//! the files that it writes, and how it answers what makes no sense.
//!
//! `tests/commands/test-command/*.stdout` hold what is printed of cases that fail; `BLESS=1 cargo
//! test --test main test_command::` writes them anew. They guard the form; that the cases fail, and
//! why, is derived here.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use pretty_assertions::assert_eq;
use serde_json::{Value, json};

const CASES: &str = "tests/commands/test-command";
const LEAVES: &str = "shaders/pass/testing/leaves";

struct Ran {
    code: Option<i32>,
    out: String,
    err: String,
}

fn run(arguments: &[&str]) -> Ran {
    run_in(Path::new(env!("CARGO_MANIFEST_DIR")), arguments)
}

fn run_in(folder: &Path, arguments: &[&str]) -> Ran {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.arg("test").args(arguments).current_dir(folder).stdin(Stdio::null());
    // Set where this runs on a machine of GitHub; annotations are told from there.
    command.env_remove("GITHUB_WORKSPACE");
    // Cases in the folder for temporary files name fixtures of the repository, which need not hold
    // that folder.
    command.args(["--root", "/"]);
    let output = command.output().expect("the command starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    Ran { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// A folder of this test's own, empty.
fn scratch(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a writable folder");
    folder
}

/// Compares what is printed of a case with a file, or writes that where `BLESS` is set.
fn prints(case: &str, code: i32) -> String {
    let pictures = scratch(&format!("pictures-{case}"));
    let pictures = pictures.to_str().expect("UTF-8");
    let ran = run(&[&format!("{CASES}/{case}"), "--pictures", pictures]);
    assert_eq!(ran.code, Some(code), "{case}: {}{}", ran.out, ran.err);
    let out = ran.out.replace(pictures, "PICTURES").replace('\\', "/");
    let name = case.trim_end_matches(".test.toml");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("{CASES}/{name}.stdout"));
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&path, &out).expect("the folder is there");
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(out, expected, "{case}: `BLESS=1 cargo test` if the new form is meant");
    out
}

#[test]
fn what_breaks_a_file_is_told_in_full_once() {
    let folder = scratch("broken-file");
    let text = "version = 1\nlaunhc = 1\n\
         [[ray]]\nname = 'first'\norigin = [0, 0, 1]\ndirection = [0, 0, -1]\nexpect = { miss = true }\n\
         [[ray]]\nname = 'second'\norigin = [0, 0, 1]\ndirection = [0, 0, -1]\nexpect = { miss = true }\n";
    std::fs::write(folder.join("rays.test.toml"), text).expect("a writable folder");
    let ran = run_in(&folder, &["."]);
    assert_eq!(ran.code, Some(2), "{}{}", ran.out, ran.err);
    assert_eq!(ran.out.matches("did you mean `launch`?").count(), 1, "{}", ran.out);
    let again =
        "ERROR  rays::second\n  error: not run, for the same reason as `rays::first`: unknown key `launhc`\n";
    assert!(ran.out.contains(again), "{}", ran.out);
}

#[test]
fn failed_hits_say_what_was_found_and_where_it_is_expected() {
    let out = prints("hits.test.toml", 1);
    assert!(out.contains("t: expected 3.5 (bits 0x40600000), found 4.0 (bits 0x40800000)"), "{out}");
    assert!(out.contains("hits.test.toml:11:5"), "the line of `t = 3.5`: {out}");
    assert!(out.contains("because: a mistake: 4 - 0 is 4"), "{out}");
    assert!(out.contains("primitive: expected 1, found 2"), "{out}");
    assert!(out.contains("expected a miss, but the ray hits instance 0, geometry 0, primitive 2"), "{out}");
    assert!(out.contains("expected a hit, but the ray misses"), "{out}");
    assert!(out.contains("this ray has no expectations yet"), "{out}");
    assert!(out.contains("the ray, explained:") && out.contains("3 of 3 primitives tested"), "{out}");
    assert!(out.ends_with("6 failed\n"), "{out}");
}

#[test]
fn a_failed_payload_names_member_and_writing_line() {
    let out = prints("payload.test.toml", 1);
    assert!(out.contains("payload.colour[1]: expected 0.75"), "{out}");
    assert!(out.contains("payload.seen: expected 3, found 2"), "{out}");
    // The line of leaf.rchit that sets the colour.
    assert!(out.contains("last written at shaders/pass/testing/leaves/leaf.rchit:13: payload.colour = vec3(0.5, 0.25, 1.0);"), "{out}");
}

#[test]
fn mistakes_in_expectations_are_errors() {
    let out = prints("mistakes.test.toml", 2);
    assert!(out.contains("struct Payload has no member `color`"), "{out}");
    assert!(out.contains("did you mean `colour`?"), "{out}");
    assert!(out.contains("the ray's direction is zero"), "{out}");
    assert!(out.ends_with("0 passed, 4 errors\n"), "{out}");
}

#[test]
fn a_failed_buffer_names_the_writing_line_and_explains_its_pixel() {
    let out = prints("buffer", 1);
    assert!(out.contains("`outputs` at byte 4: expected 5.0"), "{out}");
    assert!(
        out.contains("last written at shaders/pass/testing/leaves/main.rgen:19: distances[x] = payload.t;"),
        "{out}"
    );
    assert!(
        out.contains(
            "see also: anyhit trace-one-ray tests/commands/test-command/buffer/scene.toml --pixel 1,0"
        ),
        "{out}"
    );
}

#[test]
fn a_failed_image_is_measured_and_saved() {
    let out = prints("image", 1);
    assert!(out.contains("`picture` at texel (2, 0) byte 4: expected 0.5"), "{out}");
    // (128, 64, 255) against (0, 255, 0) in the middle of three pixels.
    assert!(
        out.contains(
            "1 of 3 texels differ, most at (1, 0): expected (0, 255, 0, 255), found (128, 64, 255, 255)"
        ),
        "{out}"
    );
    // sqrt((128^2 + 191^2 + 255^2) / 12) / 255 = sqrt(117890 / 12) / 255
    let rmse = (117_890.0f64 / 12.0).sqrt() / 255.0;
    assert!(out.contains(&format!("the RMSE is {rmse:.6}, but at most 0.01 is allowed")), "{out}");
    // The luma (ITU-T T.871) of the three pixels is 104, 149, 64 in the file and 104, 104, 64 in
    // the image, one block; the distance of the middle ones' chroma 169 and 123 of 255.
    let ([a, b, c], [d, e, f]) = ([104.0f64, 149.0, 64.0], [104.0, 104.0, 64.0]);
    let (one, two) = ((a + b + c) / 3.0, (d + e + f) / 3.0);
    let squares =
        |x: f64, y: f64, z: f64, mean: f64| (x - mean).powi(2) + (y - mean).powi(2) + (z - mean).powi(2);
    let both = (a - one) * (d - two) + (b - one) * (e - two) + (c - one) * (f - two);
    let (c1, c2) = (2.55f64.powi(2), 7.65f64.powi(2));
    let structure = (2.0 * one * two + c1) * (2.0 * both + c2)
        / ((one * one + two * two + c1) * (squares(a, b, c, one) + squares(d, e, f, two) + c2));
    let colour = (1.0 - 169.0 / 255.0f64).hypot(1.0 - 123.0 / 255.0);
    let alike = (2.0 * structure + structure.min(colour)) / 3.0;
    let words = format!("the similarity is {alike:.6}, but at least 0.9 is required");
    assert!(out.contains(&words), "{words}: {out}");
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
        .join("pictures-image/tests/commands/test-command/image/picture");
    let pixel =
        |name: &str, x| image::open(folder.join(name)).expect("a picture").to_rgba8().get_pixel(x, 0).0;
    assert_eq!(pixel("expected.png", 1), [0, 255, 0, 255]);
    assert_eq!(pixel("found.png", 1), [128, 64, 255, 255]);
    assert_eq!(pixel("difference.png", 0), [0, 0, 0, 255]);
    // The greatest difference is the brightest.
    assert_eq!(pixel("difference.png", 1), [255, 201, 128, 255]);
}

#[test]
fn failed_traps_tell_what_happened() {
    let out = prints("trap", 1);
    assert!(
        out.contains("a different invocation trapped") && out.contains("trapped at a different line"),
        "{out}"
    );
    let out = prints("no-trap", 1);
    assert!(out.contains("different trap: a buffer is accessed outside its range"), "{out}");
    let out = prints("no-trap-at-all", 1);
    assert!(out.contains("no trap; expected: OpUnreachable was reached"), "{out}");
    let out = prints("report", 1);
    assert!(out.contains("the report of the trap differs"), "{out}");
    assert!(out.contains("-    = in RayGenerationKHR `main`, launch id (4, 0, 0)"), "{out}");
    let out = prints("unexpected-trap", 3);
    assert!(out.contains("a shader trapped: a buffer is accessed outside its range"), "{out}");
    assert!(out.contains("shaders/fail/memory/out-of-bounds/main.rgen:11"), "{out}");
}

#[test]
fn failed_limits_name_the_ray() {
    let out = prints("stats", 1);
    assert!(out.contains("rays: expected 4, found 3"), "{out}");
    assert!(out.contains("max_any_hit_per_ray: a ray needs 2 any-hit invocations (allowed: 1)"), "{out}");
    assert!(out.contains("ray 0 of launch id (0, 0, 0)"), "{out}");
    // Both runs of hole.rahit, that of the hole ends early, and leaf.rchit without its branch.
    let count = |name: &str, blocks: &[usize]| {
        let path = format!("{}/spirv-fixtures/pass/testing/leaves/{name}.spv", env!("CARGO_MANIFEST_DIR"));
        let module = anyhit::Module::open(path).expect("a fixture");
        let all = &module.functions[0].blocks;
        blocks.iter().map(|&block| all[block].instructions.len()).sum::<usize>()
    };
    let needed = count("hole.rahit", &[0, 1]) + count("hole.rahit", &[0, 2]) + count("leaf.rchit", &[0, 2]);
    assert!(out.contains(&format!("a ray needs {needed} instructions (allowed: 10)")), "{needed}: {out}");
}

#[test]
fn every_field_of_a_ray_is_told_by_its_name() {
    let out = prints("fields.test.toml", 1);
    for words in [
        "instance: expected 1, found 0",
        "geometry: expected 2, found 0",
        "primitive: expected 0, found 2",
        "kind: expected 0xff, found 0xfe",
        "custom_index: expected 7, found 0",
        "t: expected 4.25 (bits 0x40880000), found 4.0 (bits 0x40800000)",
        // The ray meets the triangle at a third of its height, in the middle.
        "attribute 0: expected 0.25 (bits 0x3e800000), found 0.33333334",
        "attribute 1: expected 0.5 (bits 0x3f000000), found 0.33333334",
        "a relative difference of 2e-1 (allowed: 1.25e-1)",
        "payload.colour[1]: expected 0.5 (bits 0x3f000000), found 0.25 (bits 0x3e800000), 2.5e-1 away (allowed: 1.875e-1)",
        "no trap; expected: OpUnreachable was reached",
        "`outputs` at byte 0: expected 3.0",
        "`picture` at texel (0, 0) byte 0: expected 1.0",
        "any_hit: expected 1, found 2",
        "max_any_hit_per_ray: a ray needs 2 any-hit invocations (allowed: 1)",
        "- pixel 0 saw 3 leaves",
        "this known failure passes: remove `known_failure`",
    ] {
        assert!(out.contains(words), "{words}: {out}");
    }
    assert!(!out.contains("payload.colour[2]"), "an eighth off, and 3/16 allowed: {out}");
    assert!(out.ends_with("5 failed\n"), "{out}");
}

#[test]
fn rays_of_a_scene_are_told_by_their_names() {
    let out = prints("rays", 1);
    for words in [
        "primitive: expected 1, found 2",
        "payload.seen: expected 2, found 1",
        "because: a mistake: primitive 2 lies at x = 1, and nothing before it",
        "expected a miss, but the ray hits instance 0, geometry 0, primitive 2",
        "expected a hit, but the ray misses",
        "trace-one-ray tests/commands/test-command/rays/scene.toml --ray \"a leaf\"",
    ] {
        assert!(out.contains(words), "{words}: {out}");
    }
    let out = prints("trapped-ray", 3);
    assert!(
        out.contains("the ray `beyond the end` trapped: a buffer is accessed outside its range"),
        "{out}"
    );
}

#[test]
fn names_that_the_scene_does_not_know_are_mistakes() {
    let out = prints("unknown", 2);
    assert!(out.contains("the scene has no buffer `output`"), "{out}");
    assert!(out.contains("the scene has no image `pictures`"), "{out}");
    assert!(out.contains("the scene has no ray `a leave`"), "{out}");
    for near in ["outputs", "picture", "a leaf"] {
        assert!(out.contains(&format!("did you mean `{near}`?")), "{near}: {out}");
    }
}

#[test]
fn numbers_are_told_with_type_place_and_distance() {
    let out = prints("numbers", 1);
    for words in [
        // (4.000001 - 4) / 2^-21 = 2.097
        "`outputs` at byte 0: expected 4.000001 (bits 0x40800002), found 4.0 (bits 0x40800000), 2.097 ulp away (allowed: 1)",
        "5e-1 away (allowed: 2.5e-1)",
        "a relative difference of 2e-1 (allowed: 1.25e-1)",
        "`outputs` at byte 8: expected NaN",
        // The lower half of 4.0f's bits, 0x40800000, and the upper.
        "`outputs` at byte 0: expected 1 (bits 0x3c00), found 0 (bits 0x0000)",
        "`outputs` at byte 2: expected 16513, found 16512",
        "byte 12 is past the end of `outputs`, which has 12",
        "4 more differences in this table",
        "`picture` at texel (1, 0) byte 12: expected 0.5 (bits 0x3f000000), found 1.0 (bits 0x3f800000), 5e-1 away (allowed: 2.5e-1)",
    ] {
        assert!(out.contains(words), "{words}: {out}");
    }
}

#[test]
fn pictures_are_told_by_each_measure() {
    let out = prints("measures", 1);
    // Only the middle texel differs, by (128, 191, 255): more than 200, than a half, and than half
    // of 0.
    let each = "1 of 3 texels differ, most at (1, 0): expected (0, 255, 0, 255), found (128, 64, 255, 255)";
    assert_eq!(out.matches(each).count(), 3, "{out}");
    let floats =
        "1 of 3 texels differ, most at (1, 0): expected (0.5, 0.25, 0.5, 1.0), found (0.5, 0.25, 1.0, 1.0)";
    assert!(out.contains(floats), "{out}");
    assert!(out.contains("`picture` is 3 x 1, but the file is 4 x 1"), "{out}");
    // The words for a missing file are the system's.
    let ran = run(&[&format!("{CASES}/no-picture")]);
    assert_eq!(ran.code, Some(1), "{}{}", ran.out, ran.err);
    assert!(ran.out.contains("missing.png: ") && ran.out.contains("write it with `--bless`"), "{}", ran.out);
}

#[test]
fn every_count_is_told_by_its_key() {
    let out = prints("totals", 1);
    // Three rays: through a hole to a leaf, to a leaf, and to the sky.
    for (key, found) in [
        ("rays", 3),
        ("ray_queries", 0),
        ("reorders", 0),
        ("ray_generation", 3),
        ("intersection", 0),
        ("any_hit", 3),
        ("closest_hit", 2),
        ("miss", 1),
        ("callable", 0),
        ("compute", 0),
    ] {
        let words = format!("{key}: expected {}, found {found}", found + 1);
        assert!(out.contains(&words), "{words}: {out}");
    }
}

#[test]
fn known_failures_and_variants_are_told_as_such() {
    let out = prints("known", 1);
    assert!(out.contains("this known failure passes: remove `known_failure`"), "{out}");
    assert!(out.contains("known failure  tests/commands/test-command/known::still known: a gap\n"), "{out}");
    assert!(out.ends_with("0 passed, 1 failed, 1 known to fail\n"), "{out}");
    let out = prints("variants", 1);
    assert!(out.contains("FAILED  tests/commands/test-command/variants\n"), "{out}");
    assert!(out.contains("FAILED  tests/commands/test-command/variants (again)\n"), "{out}");
}

#[test]
fn failed_texts_are_shown_line_by_line() {
    let out = prints("stdout", 1);
    assert!(out.contains("- pixel 1 saw 1 leaves") && out.contains("+ pixel 0 saw 2 leaves"), "{out}");
    let out = prints("rendering", 1);
    assert!(out.contains("- pixel 1 saw 2 leaves"), "{out}");
    assert!(out.contains("1 of 3 pixels differ, most at (1, 0)"), "{out}");
}

#[test]
fn what_passes_is_quiet_and_in_order_with_any_number_of_jobs() {
    let one = run(&["shaders/fail", LEAVES, "--jobs", "1"]);
    assert_eq!((one.code, one.err.as_str()), (Some(0), ""));
    assert!(one.out.contains("ok  shaders/pass/testing/leaves::through the hole\n"), "{}", one.out);
    for jobs in ["2", "7"] {
        assert_eq!(run(&["shaders/fail", LEAVES, "--jobs", jobs]).out, one.out);
    }
    // Failures, too: here nothing but the order could differ.
    let paths = ["buffer", "payload.test.toml", "stats"].map(|case| format!("{CASES}/{case}"));
    let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
    let failing = |jobs| run(&[&paths[..], &["--jobs", jobs]].concat()).out;
    assert_eq!(failing("1"), failing("3"));
    // All widths agree.
    assert_eq!(run(&[LEAVES, "--all-widths"]).code, Some(0));
}

#[test]
fn tests_are_listed_filtered_and_cut_into_shards() {
    let list = |more: &[&str]| {
        let folders =
            ["shaders/fail/memory/array-index", "shaders/fail/memory/out-of-bounds", LEAVES, "--list"];
        let ran = run(&[&folders, more].concat());
        assert_eq!(ran.code, Some(0), "{}", ran.err);
        ran.out.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let all = list(&[]);
    assert_eq!(all.len(), 5, "two folders, a launch and two rays: {all:?}");
    assert_eq!(list(&["--filter", "leaves::"]).len(), 2);
    assert_eq!(list(&["--filter", "leaves::", "--filter", "array-index"]).len(), 3);
    let mut parts: Vec<String> =
        ["1/3", "2/3", "3/3"].iter().flat_map(|shard| list(&["--shard", shard])).collect();
    parts.sort();
    let mut sorted = all.clone();
    sorted.sort();
    assert_eq!(parts, sorted);
    let fail_fast = run(&[&format!("{CASES}/hits.test.toml"), "--fail-fast", "--no-explanation"]);
    assert_eq!(fail_fast.code, Some(1));
    assert!(fail_fast.out.ends_with("0 passed, 1 failed, 5 not run\n"), "{}", fail_fast.out);
}

#[test]
fn what_makes_no_sense_is_answered_with_code_2() {
    let empty = scratch("empty");
    let empty = empty.to_str().expect("UTF-8");
    let cases: [(&[&str], &str); 6] = [
        (&["no/such/folder"], "no/such/folder"),
        (&[empty], "no tests in"),
        (&[LEAVES, "--filter", "nothing like it"], "no name of the 3 tests contains \"nothing like it\""),
        (&[LEAVES, "--shard", "4/3"], "`4/3` is not K/N"),
        (&[LEAVES, "--jobs", "0"], "0"),
        (&["--init"], "`--init` requires a module"),
    ];
    for (arguments, words) in cases {
        let ran = run(arguments);
        assert_eq!(ran.code, Some(2), "{arguments:?}: {}{}", ran.out, ran.err);
        assert!(ran.err.contains(words), "{arguments:?}: {}", ran.err);
    }
    // The folder stands last.
    let module = "spirv-fixtures/pass/testing/leaves/leaf.rchit.spv";
    for folder in [empty, "no/such/folder"] {
        let ran = run(&["--init", folder, module]);
        assert_eq!(ran.code, Some(2), "{}{}", ran.out, ran.err);
        assert!(ran.err.contains(&format!("`{folder}` is not a module")), "{}", ran.err);
        let meant = format!("did you mean `anyhit test --init {module} {folder}`?");
        assert!(ran.err.contains(&meant), "{}", ran.err);
    }
    // A file that is no scene is a test that cannot run; the others run.
    let folder = scratch("broken");
    std::fs::write(folder.join("a.test.toml"), "version = 1\n[[ray]\n").expect("a writable folder");
    std::fs::write(folder.join("b.test.toml"), "version = 1\n[[ray]]\nname = 'x'\n")
        .expect("a writable folder");
    let ran = run_in(&folder, &["."]);
    assert_eq!(ran.code, Some(2));
    assert!(ran.out.contains("not TOML") && ran.out.contains("a.test.toml:2"), "{}", ran.out);
}

/// Copies a case into a folder of this test's own; what it includes stands where it stood.
fn copied(name: &str, text: &str) -> PathBuf {
    let folder = scratch(name);
    let root = env!("CARGO_MANIFEST_DIR").replace('\\', "/");
    let text = text.replace("../../shaders", &format!("{root}/shaders"));
    let path = folder.join("case.test.toml");
    std::fs::write(&path, text).expect("a writable folder");
    path
}

#[test]
fn bless_renews_recorded_values_and_nothing_else() {
    let text = "# kept\nversion = 1\ninclude = \"../../shaders/pass/testing/leaves/leaves.toml\"\n\n\
        [[ray]]  # kept, too\nname = \"a\"\norigin = [1, 0, 4]\ndirection = [0, 0, -1]\n\
        expect = { t =   3.5, payload = { seen = 9 } } # t\n\n\
        [[ray]]\nname = \"b\"\npixel = [2, 0]\n[ray.expect]\n\n\
        [[ray]]\nname = \"c\"\npixel = [0, 0]\n[ray.expect]\nt = 5\nbecause = \"derived\"\n";
    let path = copied("bless", text);
    let ran = run(&[path.to_str().expect("UTF-8"), "--bless", "--no-explanation"]);
    assert_eq!(ran.code, Some(1), "{}{}", ran.out, ran.err);
    assert!(ran.out.contains("values with `because` are derived"), "{}", ran.out);
    let root = env!("CARGO_MANIFEST_DIR").replace('\\', "/");
    let expected = text
        .replace("../../shaders", &format!("{root}/shaders"))
        .replace("t =   3.5", "t =   4.0")
        .replace("seen = 9", "seen = 1")
        .replace(
            "[ray.expect]\n\n",
            "[ray.expect]\nmiss = true\npayload = { colour = [0.25, 0.25, 0.25], t = -1.0, seen = 0 }\n\n",
        );
    assert_eq!(std::fs::read_to_string(&path).expect("the file"), expected);
    // What was recorded holds, and what was derived still does not.
    let again = run(&[path.to_str().expect("UTF-8"), "--no-explanation"]);
    assert!(again.out.ends_with("2 passed, 1 failed\n"), "{}", again.out);
}

#[test]
#[cfg(not(feature = "exr"))]
fn a_build_without_the_feature_exr_says_so() {
    let folder = scratch("no-exr");
    let root = env!("CARGO_MANIFEST_DIR").replace('\\', "/");
    let scene = format!(
        "version = 1\ninclude = \"{root}/{LEAVES}/leaves.toml\"\n[[expect.image]]\nname = \"picture\"\nfile = \"new.exr\"\n"
    );
    std::fs::write(folder.join("scene.toml"), scene).expect("a writable folder");
    let path = folder.to_str().expect("UTF-8");
    // With `--bless`, too, which would have to write the file.
    for arguments in [&[path][..], &[path, "--bless"]] {
        let ran = run(arguments);
        assert_eq!(ran.code, Some(4), "{}{}", ran.out, ran.err);
        let told = ran.out + &ran.err;
        assert!(told.contains("neither reads nor writes OpenEXR"), "{told}");
        assert!(told.contains("--features exr") && told.contains("scene.toml:5"), "{told}");
    }
}

#[test]
fn bless_renews_files_beside_a_scene() {
    // Of floats where this build writes them.
    let new = if cfg!(feature = "exr") { "new.exr" } else { "new.png" };
    let folder = scratch("bless-files");
    let root = env!("CARGO_MANIFEST_DIR").replace('\\', "/");
    let scene = format!(
        "version = 1\ninclude = \"{root}/{LEAVES}/leaves.toml\"\n[[expect.image]]\nname = \"picture\"\nfile = \"{new}\"\n"
    );
    std::fs::write(folder.join("scene.toml"), scene).expect("a writable folder");
    std::fs::write(folder.join("expect.stdout"), "").expect("a writable folder");
    std::fs::write(folder.join("expect.png"), "").expect("a writable folder");
    let path = folder.to_str().expect("UTF-8");
    assert_eq!(run(&[path]).code, Some(1));
    let ran = run(&[path, "--bless"]);
    assert_eq!(ran.code, Some(0), "{}{}", ran.out, ran.err);
    assert_eq!(
        std::fs::read_to_string(folder.join("expect.stdout")).expect("the file"),
        "pixel 0 saw 2 leaves\n"
    );
    let found = image::open(folder.join(new)).expect("a picture").to_rgba32f().get_pixel(0, 0).0;
    // Of `render`'s 8 bits there are 0.5 and 0.25 to the nearest of 255 levels.
    let expected =
        if cfg!(feature = "exr") { [0.5, 0.25, 1.0, 1.0] } else { [128.0 / 255.0, 64.0 / 255.0, 1.0, 1.0] };
    assert_eq!(found, expected);
    assert_eq!(run(&[path]).code, Some(0));
}

#[test]
fn a_scene_with_rays_alone_is_tested_by_them() {
    let folder = scratch("rays-alone");
    let root = env!("CARGO_MANIFEST_DIR").replace('\\', "/");
    let write = |payload: &str| {
        let scene = format!(
            "version = 1\n[shaders]\nhit = \"{root}/spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv\"\n\
             [pipeline]\nhit = [{{ closest_hit = \"hit\" }}]\n\
             [geometry.g]\ntype = \"spheres\"\npositions = [[0, 0, 0]]\nradii = [0.5]\n[[instance]]\ngeometry = \"g\"\n\
             [[ray]]\nname = \"r\"\norigin = [0, 0, 4]\ndirection = [0, 0, -1]\npayload = {{ f32 = {payload} }}\n\
             expect = {{ t = 3.5, payload = {{ normal = [-0.0, 0, 1] }} }}\n"
        );
        std::fs::write(folder.join("scene.toml"), scene).expect("a writable folder");
    };
    let folder = folder.to_str().expect("UTF-8");
    write("[0, 0, 0, 0, 0]");
    let listed = run(&[folder, "--list"]).out;
    assert_eq!(listed.lines().count(), 1, "nothing is launched: {listed}");
    assert!(listed.ends_with("::r\n"), "{listed}");
    let ran = run(&[folder]);
    assert_eq!(ran.code, Some(1));
    let words = "payload.normal[0]: expected -0.0 (bits 0x80000000), found 0.0 (bits 0x00000000): zeros of opposite sign";
    assert!(ran.out.contains(words), "{}", ran.out);
    // Nine words for a vec3, a float and a uint.
    write("[0, 0, 0, 0, 0, 0, 0, 0, 0]");
    let ran = run(&[folder]);
    assert_eq!(ran.code, Some(2));
    for words in [
        "has 36 bytes, but the shaders declare 20",
        "offset  struct Payload",
        "     0  vec3 normal",
        "    16  uint hits",
    ] {
        assert!(ran.out.contains(words), "{words}: {}", ran.out);
    }
}

#[test]
fn json_tells_everything() {
    let ran = run(&[&format!("{CASES}/payload.test.toml"), LEAVES, "--format", "json"]);
    assert_eq!(ran.code, Some(1));
    let report: Value = serde_json::from_str(&ran.out).expect("JSON");
    assert_eq!((&report["version"], &report["passed"], &report["failed"]), (&json!(1), &json!(3), &json!(1)));
    let test = &report["tests"][0];
    assert_eq!(test["name"], "tests/commands/test-command/payload::colour and count");
    assert_eq!(test["outcome"], "failed");
    assert_eq!(
        test["differences"][0]["at"],
        json!({ "file": "tests/commands/test-command/payload.test.toml", "line": 11 })
    );
    assert_eq!(test["line"]["line"], 13);
    assert!(
        test["explanation"].as_str().is_some_and(|transcript| transcript.contains("candidate")),
        "{test}"
    );
}

#[test]
fn github_gets_an_annotation_on_the_shader_s_line() {
    let ran = run(&[&format!("{CASES}/payload.test.toml"), "--format", "github", "--no-explanation"]);
    let annotation = ran.out.lines().find(|line| line.starts_with("::error ")).expect("an annotation");
    let head = "::error file=shaders/pass/testing/leaves/leaf.rchit,line=13,title=tests/commands/test-command/payload%3A%3Acolour and count::";
    assert!(annotation.starts_with(head), "{annotation}");
    assert!(annotation.contains("%0A"), "lines are escaped: {annotation}");
}

/// GitHub looks for commands in every line of a log, behind blanks, too.
#[test]
fn what_a_test_says_is_no_workflow_command() {
    let folder = scratch("commands");
    let leaves = Path::new(env!("CARGO_MANIFEST_DIR")).join(LEAVES).join("leaves.toml");
    let text = format!(
        r#"version = 1
           include = '{}'
           [[ray]]
           name = "a"
           origin = [1, 0, 4]
           direction = [0, 0, -1]
           expect = {{ t = 3.5, because = "what\n::add-mask::a\n::stop-commands::b" }}"#,
        leaves.display()
    );
    std::fs::write(folder.join("a.test.toml"), text).expect("a writable folder");
    let ran = run(&[folder.to_str().expect("UTF-8"), "--format", "github"]);
    // What the file says stays within its line.
    let commands: Vec<&str> =
        ran.out.lines().map(str::trim_start).filter(|line| line.starts_with("::")).collect();
    let [group, end, annotation] = commands[..] else { panic!("{}", ran.out) };
    assert!(group.starts_with("::group::FAILED  "), "{group}");
    assert_eq!(end, "::endgroup::");
    assert!(annotation.starts_with("::error file="), "{annotation}");
    assert!(ran.out.contains(r"what\u000a::add-mask::a\u000a::stop-commands::b"), "{}", ran.out);
}

#[test]
fn every_kind_of_failure_stands_in_every_format() {
    let folder = scratch("formats");
    let (xml, pictures) = (folder.join("report.xml"), folder.join("pictures"));
    let [xml, pictures] = [&xml, &pictures].map(|path| path.to_str().expect("UTF-8"));
    let more = ["--junit", xml, "--pictures", pictures, "--no-explanation"];
    let ran = run(&[&[CASES, "--format", "json"], &more[..]].concat());
    assert_eq!(ran.code, Some(2));
    let report: Value = serde_json::from_str(&ran.out).expect("JSON");
    let text = std::fs::read(xml).expect("the report");
    let junit = junit_parser::from_reader(text.as_slice()).expect("JUnit XML");
    let mut cases = junit.suites.iter().flat_map(|suite| &suite.cases);
    let github = run(&[&[CASES, "--format", "github"], &more[2..]].concat()).out;
    let mut annotations = github.lines().filter(|line| line.starts_with("::error "));
    let tests = report["tests"].as_array().expect("an array");
    assert!(tests.len() > 30, "{}", tests.len());
    for test in tests {
        let (name, case) = (test["name"].as_str().expect("a text"), cases.next().expect("a test case"));
        assert_eq!(case.original_name, name);
        let (error, found) = match test["outcome"].as_str() {
            Some("failed") => (&test["differences"][0], &case.status.failure_as_ref().message),
            Some("error") => (&test["error"], &case.status.error_as_ref().message),
            Some("known_failure") => {
                assert_eq!(case.system_out.as_deref(), Some("known failure: a gap"));
                continue;
            }
            other => panic!("{name}: {other:?}"),
        };
        assert_eq!(error["message"].as_str(), Some(found.as_str()), "{name}");
        let place = if test["line"].is_object() { &test["line"] } else { &error["at"] };
        let (file, line) = (place["file"].as_str().expect("a file"), place["line"].as_u64().expect("a line"));
        let annotation = annotations.next().expect("an annotation");
        let rest = annotation.strip_prefix(&format!("::error file={file},line={line},"));
        assert!(
            rest.is_some_and(|rest| rest.starts_with("title=") || rest.starts_with("col=")),
            "{annotation}"
        );
        let text =
            std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).expect("the annotated file");
        let lines = text.iter().filter(|&&byte| byte == b'\n').count() as u64;
        assert!((1..=lines.max(1)).contains(&line), "{annotation}");
    }
    assert_eq!((cases.next().map(|case| &case.name), annotations.next()), (None, None));
}

#[test]
fn junit_counts_and_holds_every_test() {
    let path = scratch("junit").join("report.xml");
    let paths = ["payload.test.toml", "mistakes.test.toml"].map(|case| format!("{CASES}/{case}"));
    let ran = run(&[&paths[0], &paths[1], LEAVES, "--junit", path.to_str().expect("UTF-8")]);
    assert_eq!(ran.code, Some(2));
    let text = std::fs::read(&path).expect("the report");
    let root = junit_parser::from_reader(text.as_slice()).expect("JUnit XML");
    assert_eq!((root.tests, root.failures, root.errors, root.skipped), (8, 1, 4, 0));
    let counts = |suite: &junit_parser::TestSuite| (suite.tests, suite.failures, suite.errors);
    // One suite for each file.
    assert_eq!(root.suites.iter().map(counts).collect::<Vec<_>>(), [(1, 1, 0), (4, 0, 4), (3, 0, 0)]);
    assert_eq!(root.suites[0].name.replace('\\', "/"), paths[0]);
    let failed = &root.suites[0].cases[0];
    assert_eq!(failed.original_name, "tests/commands/test-command/payload::colour and count");
    assert_eq!(failed.classname.as_deref(), Some("tests.commands.test-command.payload"));
    assert_eq!(failed.file.as_deref(), Some(paths[0].as_str()));
    let failure = failed.status.failure_as_ref();
    assert!(failure.message.contains("payload.colour[1]: expected 0.75"), "{failure:?}");
    assert!(
        failure.text.contains("leaf.rchit:13") && failure.text.contains("the ray, explained:"),
        "{failure:?}"
    );
    let error = root.suites[1].cases[0].status.error_as_ref();
    assert!(error.message.contains("struct Payload has no member `color`"), "{error:?}");
    assert!(root.suites[2].cases.iter().all(|case| case.status.is_success()));
}

/// A ray stands at its `[[ray]]`, a launch at the begin of its file.
#[test]
fn a_list_has_files_and_lines() {
    let ran = run(&[CASES, LEAVES, "--list", "--format", "json"]);
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    let list: Value = serde_json::from_str(&ran.out).expect("JSON");
    let tests = list["tests"].as_array().expect("tests");
    let names = run(&[CASES, LEAVES, "--list"]).out;
    assert_eq!(
        tests.iter().map(|test| test["name"].as_str()).collect::<Vec<_>>(),
        names.lines().map(Some).collect::<Vec<_>>()
    );
    for test in tests {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(test["file"].as_str().expect("a file"));
        let text = std::fs::read_to_string(&file).expect("the test's file");
        let line = test["line"].as_u64().expect("a line") as usize;
        match test["name"].as_str().and_then(|name| name.split_once("::")) {
            None => assert_eq!(line, 1, "{test}"),
            Some((_, ray)) => {
                assert!(text.lines().nth(line - 1).expect("a line").starts_with("[[ray]]"), "{test}");
                let own = text.lines().skip(line).take_while(|line| !line.starts_with("[[ray]]"));
                let is_named = own.clone().any(|line| line.starts_with("name =") && line.contains(ray));
                assert!(is_named || ray.starts_with("ray "), "{test}");
            }
        }
    }
}

/// The kinds of failures in a folder of one case each, and the codes of the page.
#[test]
fn the_exit_code_is_that_of_the_most_severe_failure() {
    let case = |name: &str| format!("{CASES}/{name}");
    for (cases, code) in [
        (&["payload.test.toml"][..], 1),
        (&["unexpected-trap/scene.toml"], 3),
        (&["trapped-ray/scene.toml"], 3),
        (&["payload.test.toml", "unexpected-trap/scene.toml"], 3),
        (&["unexpected-trap/scene.toml", "mistakes.test.toml"], 2),
    ] {
        let paths: Vec<String> = cases.iter().map(|name| case(name)).collect();
        let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
        assert_eq!(run(&paths).code, Some(code), "{cases:?}");
    }
    // The payload's file is larger than it may be: nothing of it runs.
    assert_eq!(run(&[&case("payload.test.toml"), "--limit", "scene-bytes=10"]).code, Some(5));
}

/// The names of tests that did not pass end the report, each once, before the counts.
#[test]
fn the_report_ends_with_the_names_of_what_failed() {
    let paths = ["payload.test.toml", "mistakes.test.toml"].map(|name| format!("{CASES}/{name}"));
    for more in [&[][..], &["--format", "github"]] {
        let ran = run(&[&[&*paths[0], &paths[1], LEAVES, "--no-explanation"], more].concat());
        let json = run(&[&paths[0], &paths[1], LEAVES, "--format", "json", "--no-explanation"]);
        let json: Value = serde_json::from_str(&json.out).expect("JSON");
        let failed: Vec<String> = json["tests"]
            .as_array()
            .expect("tests")
            .iter()
            .filter_map(|test| {
                let word = if test["outcome"] == "failed" { "FAILED" } else { "ERROR " };
                let is_wrong = test["outcome"] == "failed" || test["outcome"] == "error";
                is_wrong.then(|| format!("  {word}  {}", test["name"].as_str().expect("a name")))
            })
            .collect();
        assert!(failed.len() >= 2, "{json}");
        let (_, end) = ran.out.split_once("did not pass:\n").expect("the list");
        let (names, counts) = end.split_once("\n\n").expect("the counts");
        assert_eq!(names.lines().collect::<Vec<_>>(), failed);
        assert!(counts.contains(" passed, ") && counts.lines().count() == 1, "{counts}");
    }
    let ran = run(&[LEAVES]);
    assert!(!ran.out.contains("did not pass"), "{}", ran.out);
}

/// The fields that GitLab requires of a report of code quality: description, name of the check,
/// fingerprint, severity and place (docs.gitlab.com, "Code Quality report format").
#[test]
fn gitlab_has_an_issue_for_every_failure() {
    let ran = run(&[CASES, "--format", "gitlab", "--no-explanation"]);
    assert_eq!(ran.code, Some(2));
    let report: Value = serde_json::from_str(&ran.out).expect("JSON");
    let issues = report.as_array().expect("an array");
    let json = run(&[CASES, "--format", "json", "--no-explanation"]);
    let json: Value = serde_json::from_str(&json.out).expect("JSON");
    let count = |key: &str| json[key].as_u64().expect("a count") as usize;
    assert_eq!(issues.len(), count("failed") + count("errors"));
    let mut fingerprints = std::collections::BTreeSet::new();
    for issue in issues {
        let text = |key: &str| issue[key].as_str().unwrap_or_else(|| panic!("{key}: {issue}"));
        assert!(!text("description").is_empty() && text("check_name").starts_with("test-"), "{issue}");
        assert!(["info", "minor", "major", "critical", "blocker"].contains(&text("severity")), "{issue}");
        assert!(fingerprints.insert(text("fingerprint").to_owned()), "{issue}");
        let path = issue["location"]["path"].as_str().expect("a path");
        assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(path).is_file(), "{path}");
        assert!(!path.contains("..") && !path.starts_with("./"), "{path}");
        assert!(issue["location"]["lines"]["begin"].as_u64().is_some_and(|line| line > 0), "{issue}");
    }
}

/// A failed test is a result at the line that is to blame, and a row of the short report.
#[test]
fn sarif_and_the_summary_list_failed_tests() {
    let folder = scratch("tools");
    let file = |name: &str| folder.join(name).to_str().expect("UTF-8").to_owned();
    let (sarif, summary) = (file("a.sarif"), file("a.md"));
    let payload = format!("{CASES}/payload.test.toml");
    let ran = run(&[&payload, LEAVES, "--sarif", &sarif, "--summary", &summary]);
    assert_eq!(ran.code, Some(1), "{}", ran.err);
    let text = std::fs::read_to_string(&sarif).expect("the results");
    let sarif: Value = serde_json::from_str(&text).expect("JSON");
    let run = &sarif["runs"][0];
    let results = run["results"].as_array().expect("results");
    assert_eq!(results.len(), 1, "{text}");
    assert_eq!((&results[0]["ruleId"], &results[0]["level"]), (&"test-failed".into(), &"error".into()));
    let rules = run["tool"]["driver"]["rules"].as_array().expect("rules");
    assert!(rules.iter().any(|rule| rule["id"] == results[0]["ruleId"]), "{text}");
    let place = &results[0]["locations"][0]["physicalLocation"];
    let uri = place["artifactLocation"]["uri"].as_str().expect("a path");
    // The line that writes the second component, as the text of the failure says.
    assert!(uri.ends_with("testing/leaves/leaf.rchit"), "{uri}");
    assert_eq!(place["region"]["startLine"], 13);
    let rule = results[0]["ruleIndex"].as_u64().expect("the index of a rule");
    assert_eq!(rules[rule as usize]["id"], "test-failed");
    assert!(results[0]["partialFingerprints"].as_object().is_some_and(|prints| !prints.is_empty()), "{text}");
    let summary = std::fs::read_to_string(&summary).expect("the summary");
    let row = summary.lines().find(|line| line.starts_with("| tests/")).expect("a row");
    assert!(summary.starts_with("### anyhit: 3 passed, 1 failed\n"), "{summary}");
    assert!(row.contains("payload") && row.contains("leaf.rchit:13") && row.contains("0.75"), "{row}");
}

/// Several scenes that lead to one source by different ways have one record of it, whose name
/// contains no `..`; Cobertura has the same lines and counts.
#[test]
fn coverage_has_one_record_of_a_file() {
    let folder = scratch("one-record");
    let tree = |name: &str| folder.join(name);
    std::fs::create_dir_all(tree("shaders")).expect("a folder");
    std::fs::write(
        tree("shaders/c.wgsl"),
        "@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;\n\
         @compute @workgroup_size(1)\nfn main() {\n    numbers[0] = 7u;\n}\n",
    )
    .expect("a file");
    for case in ["a", "b"] {
        let scene = "version = 1\n[shaders]\nmain = '../../shaders/c.wgsl'\n[[dispatch]]\nshader = 'main'\n\
                     groups = 1\n[resources.numbers]\ntype = 'storage_buffer'\nbinding = 0\nsize = 4\n\
                     [[expect.buffer]]\nname = 'numbers'\nu32 = [7]\nbecause = 'the shader'\n";
        std::fs::create_dir_all(tree("cases").join(case)).expect("a folder");
        std::fs::write(tree("cases").join(case).join("scene.toml"), scene).expect("a file");
    }
    for (name, record) in [("c.lcov", "SF:"), ("c.xml", "filename=")] {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_anyhit"));
        command.args(["test", "cases", "--root", ".", "--coverage", name]).current_dir(&folder);
        let output = command.output().expect("the program");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read_to_string(tree(name)).expect("the coverage");
        assert_eq!(text.matches(record).count(), 1, "{text}");
        assert!(text.contains("shaders/c.wgsl") && !text.contains(".."), "{text}");
        // Line 4 ran once in each case.
        assert!(text.contains("DA:4,2") || text.contains("<line number=\"4\" hits=\"2\""), "{text}");
    }
}

#[test]
fn coverage_counts_lines_and_ways_of_branches() {
    let path = scratch("coverage").join("out.lcov");
    let ran = run(&[LEAVES, "--filter", "leaves", "--coverage", path.to_str().expect("UTF-8")]);
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    let report = lcov::Report::from_file(&path).expect("a tracefile");
    let section = |name: &str| {
        let mut sections = report.sections.iter().filter(|(key, _)| key.source_file.ends_with(name));
        let (key, section) = sections.next().expect("the file's section");
        assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(&key.source_file).is_file(), "{key:?}");
        assert_eq!(sections.next(), None);
        section
    };
    let line = |name: &str, line| {
        section(name).lines.get(&lcov::report::section::line::Key { line }).map(|value| value.count)
    };
    // The launch: three invocations, candidates 2 + 1 + 0. The first ray: two candidates, a hit.
    // The second, pixel 2: a miss.
    assert_eq!(line("main.rgen", 19), Some(3 + 1), "distances[x] = payload.t;");
    assert_eq!(line("main.rgen", 22), Some(1), "debugPrintfEXT, of pixel 0 alone");
    assert_eq!(line("hole.rahit", 12), Some(3 + 2), "payload.seen += 1u;");
    assert_eq!(line("hole.rahit", 14), Some(1 + 1), "ignoreIntersectionEXT;");
    assert_eq!(line("leaf.rchit", 12), Some(2 + 1), "payload.t = gl_HitTEXT;");
    assert_eq!(line("leaf.rchit", 15), Some(0), "no leaf is far away");
    assert_eq!(line("sky.rmiss", 12), Some(1 + 1), "payload.t = -1.0;");
    assert_eq!(line("main.rgen", 6), None, "a comment");
    let ways = |name: &str, line| {
        let ways = section(name).branches.iter().filter(|(way, _)| way.line == line);
        ways.map(|(_, value)| value.taken).collect::<Vec<_>>()
    };
    assert_eq!(ways("main.rgen", 21), [Some(1), Some(3)]);
    assert_eq!(ways("hole.rahit", 13), [Some(2), Some(3)]);
    assert_eq!(ways("leaf.rchit", 14), [Some(0), Some(3)]);
    let entered = |name: &str| section(name).functions.values().map(|value| value.count).collect::<Vec<_>>();
    assert_eq!(entered("hole.rahit"), [3 + 2]);
    // What the writer sums up is what the reader counts.
    let records = |keyword: &str| {
        let text = std::fs::read_to_string(&path).expect("the tracefile");
        let numbers = text
            .lines()
            .filter_map(|line| line.strip_prefix(keyword)?.strip_prefix(':')?.parse::<usize>().ok());
        numbers.sum::<usize>()
    };
    let sum = |count: fn(&lcov::report::section::Value) -> usize| {
        report.sections.values().map(count).sum::<usize>()
    };
    assert_eq!(records("LF"), sum(|one| one.lines.len()));
    assert_eq!(records("LH"), sum(|one| one.lines.values().filter(|line| line.count > 0).count()));
    assert_eq!(records("BRF"), sum(|one| one.branches.len()));
    let taken = |way: &lcov::report::section::branch::Value| way.taken.is_some_and(|taken| taken > 0);
    assert_eq!(
        records("BRH"),
        report.sections.values().flat_map(|one| one.branches.values()).filter(|way| taken(way)).count()
    );
    assert_eq!(records("FNF"), sum(|one| one.functions.len()));
    // And what rays came to.
    for words in [
        "hit groups        1 of 1 (100.0 %)",
        "miss shaders      1 of 1 (100.0 %)",
        "any-hit outcomes  2 of 3 (66.7 %)",
        "never: terminated",
        "ignored: 2",
        "surfaces          1 of 2 (50.0 %)",
        "never: triangle, ",
    ] {
        assert!(ran.out.contains(words), "{words}: {}", ran.out);
    }
}

#[cfg(feature = "wgsl")]
#[test]
fn coverage_counts_dispatches_and_ray_queries() {
    let folder = scratch("coverage-compute");
    let text = std::fs::read_to_string("shaders/pass/ray-query/compute/scene.toml").expect("the scene");
    let root = env!("CARGO_MANIFEST_DIR").replace('\\', "/");
    // The dispatch of the WGSL alone, from its source.
    let scene = text.split("[[expect").next().unwrap_or_default();
    let scene = scene
        .replacen("[[dispatch]]\nshader = \"glsl\"\ngroups = [1, 2]\n", "", 1)
        .replace("../../../..", &root)
        .replace(
            "spirv-fixtures/pass/ray-query/compute/main.wgsl.spv",
            "shaders/pass/ray-query/compute/main.wgsl",
        );
    assert_eq!(scene.matches("[[dispatch]]").count(), 1);
    std::fs::write(folder.join("scene.toml"), scene).expect("a writable folder");
    let path = folder.join("out.lcov");
    let [folder, out] = [&folder, &path].map(|path| path.to_str().expect("UTF-8"));
    let ran = run(&[folder, "--coverage", out]);
    assert_eq!(ran.code, Some(0), "{}{}", ran.out, ran.err);
    let report = lcov::Report::from_file(&path).expect("a tracefile");
    let section = report.sections.values().next().expect("one file");
    let line = |line| section.lines.get(&lcov::report::section::line::Key { line }).map(|value| value.count);
    // Two workgroups of 64 invocations; 54 and 38 of their rays hit, as the scene derives.
    assert_eq!(line(22), Some(128), "rayQueryInitialize");
    assert_eq!(line(26), Some(54 + 38), "atomicAdd");
    assert_eq!(line(30), Some(2), "the first invocation of each workgroup");
    let ways = section.branches.iter().filter(|(way, _)| way.line == 29).map(|(_, value)| value.taken);
    assert_eq!(ways.collect::<Vec<_>>(), [Some(2), Some(126)]);
    for words in [
        "ray-query flags   1 of 1 (100.0 %)",
        "OpaqueKHR: 128",
        "ray-query commits 1 of 2 (50.0 %)",
        "triangle, front: 92",
        "never: triangle, back",
    ] {
        assert!(ran.out.contains(words), "{words}: {}", ran.out);
    }
}

#[test]
fn coverage_says_what_it_cannot_know() {
    let path = scratch("no-lines").join("out.lcov");
    let ran = run(&["shaders/pass/sphere", "--coverage", path.to_str().expect("UTF-8")]);
    assert!(ran.out.contains("3 modules without lines: compile with debug information (-g)"), "{}", ran.out);
}

#[test]
fn a_first_case_is_written_and_runs() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let spv = |name: &str| root.join("spirv-fixtures").join(name).display().to_string();
    let one = |name: &str, modules: &[String], words: &[&str]| {
        let folder = scratch(&format!("init-{name}")).join("case");
        let folder = folder.to_str().expect("UTF-8");
        let modules: Vec<&str> = modules.iter().map(String::as_str).collect();
        let ran = run(&[&["--init"], &modules[..], &[folder]].concat());
        assert_eq!(ran.code, Some(0), "{name}: {}{}", ran.out, ran.err);
        let text = std::fs::read_to_string(Path::new(folder).join("scene.toml")).expect("the scene");
        let ran = run(&[folder]);
        assert_eq!(ran.code, Some(0), "{name}: {}{}\n{text}", ran.out, ran.err);
        for words in words {
            assert!(text.contains(words), "{words}: {text}");
        }
        // It does not write over what is there.
        let again = run(&[&["--init"], &modules[..], &[folder]].concat());
        assert_eq!(again.code, Some(2));
        assert!(again.err.contains("already exists"), "{}", again.err);
    };
    // (4 - 1/2) on a sphere around the origin, slightly less off its axis.
    one(
        "sphere",
        &[spv("pass/sphere/closest-hit/main.rchit.spv"), spv("pass/sphere/closest-hit/main.rmiss.spv")],
        &["closest_hit = \"closest_hit\"", "miss = [\"miss\"]", "primitive = 0", "normal = ["],
    );
    one("lss", &[spv("pass/lss/normal-angle/main.rchit.spv")], &["type = \"lss\"", "t = 3.5"]);
    one(
        "leaves",
        &["hole.rahit", "leaf.rchit", "main.rgen", "sky.rmiss"]
            .map(|name| spv(&format!("pass/testing/leaves/{name}.spv"))),
        &[
            "raygen = [\"raygen\"]",
            "any_hit = \"any_hit\"",
            "type = \"storage_image\"",
            "[expect.stats]\nrays = 1",
        ],
    );
}

#[test]
fn a_whole_scene_is_written_and_renders() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = scratch("init-scene");
    let anyhit = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
        let output = command.args(arguments).current_dir(&folder).stdin(Stdio::null()).output();
        let output = output.expect("the command starts");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let modules = ["hole.rahit", "leaf.rchit", "main.rgen", "sky.rmiss"];
    let modules = modules.map(|name| {
        root.join(format!("spirv-fixtures/pass/testing/leaves/{name}.spv")).display().to_string()
    });
    let mut arguments = vec!["scene", "--init"];
    arguments.extend(modules.iter().map(String::as_str));
    let (code, out, error) = anyhit(&arguments);
    assert_eq!(code, Some(0), "{out}{error}");
    assert!(out.contains("run it: anyhit render scene.toml"), "{out}");
    let scene = std::fs::read_to_string(folder.join("scene.toml")).expect("the scene");
    for words in ["launch = [64, 64]", "raygen = [\"raygen\"]", "output = true", "type = \"triangles\""] {
        assert!(scene.contains(words), "{words}: {scene}");
    }
    let (code, out, error) = anyhit(&["render", "scene.toml", "-o", "out.png"]);
    assert_eq!(code, Some(0), "{out}{error}");
    assert!(folder.join("out.png").is_file());
    let (code, _, error) = anyhit(&arguments);
    assert!(code == Some(2) && error.contains("scene.toml already exists"), "{error}");
}

/// What a first case reads and runs has the limits and the root of all tests.
#[test]
fn a_first_case_keeps_to_limits_and_root() {
    let folder = scratch("init-limits");
    let endless = crate::support::assembly::assemble(
        "OpCapability RayTracingKHR
         OpExtension \"SPV_KHR_ray_tracing\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint RayGenerationKHR %main \"main\"
         %void = OpTypeVoid
         %function = OpTypeFunction %void
         %main = OpFunction %void None %function
         %begin = OpLabel
         OpBranch %head
         %head = OpLabel
         OpLoopMerge %end %continue None
         OpBranch %continue
         %continue = OpLabel
         OpBranch %head
         %end = OpLabel
         OpReturn
         OpFunctionEnd",
    );
    std::fs::write(folder.join("endless.spv"), endless).expect("a writable folder");
    std::fs::create_dir_all(folder.join("inside")).expect("a writable folder");
    let init = |case: &str, arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
        command.args(["test", "--init", "endless.spv", case]).args(arguments);
        let output = command.current_dir(&folder).stdin(Stdio::null()).output().expect("the command starts");
        let error = String::from_utf8(output.stderr).expect("UTF-8");
        (output.status.code(), error, std::fs::read_to_string(folder.join(case).join("scene.toml")).ok())
    };
    let (code, error, scene) = init("small", &["--limit", "module-bytes=100"]);
    assert!(code == Some(5) && error.contains("the limit `module-bytes` of 100"), "{error}");
    assert_eq!(scene, None);
    let (code, error, scene) = init("inside/case", &["--root", "inside"]);
    assert!(code == Some(2) && error.contains("endless.spv: outside the folder"), "{error}");
    assert_eq!(scene, None);
    let (code, error, scene) = init("../init-outside", &["--root", "."]);
    assert!(code == Some(2) && error.contains("outside the folder"), "{error}");
    assert_eq!(scene, None);
    let (_, error, scene) = init("fuel", &["--root", ".", "--fuel", "5000"]);
    let scene = scene.unwrap_or_else(|| panic!("{error}"));
    assert!(scene.contains("out of fuel"), "{error}{scene}");
}

/// What is printed is typed into a shell, and finds the ray again.
#[cfg(unix)]
#[test]
fn a_printed_command_line_works_when_it_is_typed() {
    let folder = scratch("a folder with blanks");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = std::fs::read_to_string(root.join(CASES).join("rays/scene.toml")).expect("a scene");
    let include = format!("{}/", root.join(CASES).display());
    for name in ["name, with comma", "1, 2, 3", "it's $HOME", "plain"] {
        let text = scene
            .replace("\"../", &format!("\"{include}"))
            .replace("\"a leaf\"", &format!("\"{name}\""))
            .replace("primitive = 1\n", "primitive = 3\n");
        std::fs::write(folder.join("scene.toml"), text).expect("a writable folder");
        let ran = run_in(&folder, &[folder.to_str().expect("UTF-8")]);
        let typed = ran.out.lines().find_map(|line| line.trim().strip_prefix("see also: anyhit "));
        let typed = typed.unwrap_or_else(|| panic!("{name}: {}{}", ran.out, ran.err));
        let line = format!("'{}' {typed} --root / --json", env!("CARGO_BIN_EXE_anyhit"));
        let output = Command::new("sh").args(["-c", &line]).current_dir(&folder).output().expect("a shell");
        let told: Value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|error| panic!("{line}: {error}: {}", String::from_utf8_lossy(&output.stderr)));
        assert_eq!(told["ray_name"], name, "{line}");
    }
}

/// asin(1/8) is 7.181 degrees.
#[test]
fn a_normal_that_is_projected_on_the_axis_is_off_by_the_slope() {
    let out = prints("normal.test.toml", 1);
    assert!(out.contains("7.181 degrees away (allowed: 1)"), "{out}");
    assert!(out.contains("`angle` is float, not a vector of three numbers"), "{out}");
    assert!(out.contains("expected a normal, but the ray misses"), "{out}");
    assert_eq!(out.lines().filter(|line| line.starts_with("FAILED")).count(), 4, "{out}");
}
