//! Shares of long commands, and `anyhit merge`: what is merged is what one run gives, byte for
//! byte, and what does not belong together is refused.

use std::path::Path;

use pretty_assertions::assert_eq;
use serde_json::Value;

use crate::support::program::{Ran, anyhit, anyhit_with, at, scratch};

const LEAVES: &str = "shaders/pass/testing/leaves";

/// Runs the shares of a command, and returns their files.
fn shares(folder: &Path, of: usize, arguments: &[&str]) -> Vec<String> {
    let share = |number: usize| {
        let (shard, file) = (format!("{number}/{of}"), at(folder, &format!("{number}.json")));
        let ran = anyhit(&[arguments, &["--shard", &shard, "--result", &file]].concat());
        assert!(Path::new(&file).is_file(), "{arguments:?}: {}{}", ran.out, ran.err);
        file
    };
    (1..=of).map(share).collect()
}

fn merge(files: &[String], more: &[&str]) -> Ran {
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    anyhit(&[&["merge"], &files[..], more].concat())
}

fn bytes(path: &str) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Passes, failures of every kind, files that are no scenes, and coverage.
#[test]
fn the_reports_of_merged_tests_are_those_of_one_run() {
    let folder = scratch("shares-tests");
    let pictures = at(&folder, "pictures");
    // Relative to the root: as GitHub's runner has it, whose paths are told from there.
    let tests =
        ["test", "tests/commands/test-command", LEAVES, "shaders/pass/ray-query", "--pictures", &pictures];
    for format in ["plain", "json", "github"] {
        let [lcov, junit, merged_lcov, merged_junit] =
            ["whole.lcov", "whole.xml", "merged.lcov", "merged.xml"].map(|name| at(&folder, name));
        let covered = [&tests[..], &["--format", format, "--coverage", &lcov]].concat();
        let whole = anyhit(&[&covered[..], &["--junit", &junit, "--no-times"]].concat());
        let files = shares(&folder, 3, &covered);
        std::fs::remove_file(&lcov).expect("a tracefile");
        let whole_again = anyhit(&covered);
        assert_eq!(whole_again.out, whole.out, "{format}");
        let more = ["--format", format, "--coverage", &merged_lcov, "--junit", &merged_junit];
        let merged = merge(&files, &more);
        assert_eq!(merged.out, whole.out, "{format}");
        assert_eq!((merged.code, whole.code), (Some(2), Some(2)), "{}", merged.err);
        assert!(bytes(&merged_junit) == bytes(&junit), "{format}: the JUnit reports differ");
        assert!(bytes(&merged_lcov) == bytes(&lcov), "{format}: the tracefiles differ");
        assert!(!String::from_utf8_lossy(&bytes(&junit)).contains(" time="));
    }
}

/// The first test of a file tells what is wrong with it, and the others name that one: those of
/// other shares, too.
#[test]
fn what_breaks_a_file_is_told_once_in_all_shares() {
    let folder = scratch("shares-broken-file");
    let ray = |name: &str| {
        format!(
            "[[ray]]\nname = '{name}'\norigin = [0, 0, 1]\ndirection = [0, 0, -1]\nexpect = {{ miss = true }}\n"
        )
    };
    let text = format!("version = 1\nlaunhc = 1\n{}{}{}", ray("first"), ray("second"), ray("third"));
    std::fs::write(folder.join("rays.test.toml"), text).expect("a writable folder");
    let tests = ["test", folder.to_str().expect("UTF-8"), "tests/commands/test-command/known"];
    let whole = anyhit(&tests);
    let merged = merge(&shares(&folder_of("broken-results"), 2, &tests), &[]);
    assert_eq!((merged.out, merged.code), (whole.out, whole.code));
}

#[test]
fn merging_is_associative_and_commutative() {
    let folder = scratch("shares-groups");
    let files = shares(&folder, 3, &["test", LEAVES, "tests/commands/test-command/trap", "--shadow"]);
    let merged = |name: &str, files: &[&String]| {
        let file = at(&folder, name);
        let files: Vec<String> = files.iter().map(|file| (*file).clone()).collect();
        let ran = merge(&files, &["--partial", "--result", &file]);
        assert!(matches!(ran.code, Some(0 | 1)), "{}{}", ran.out, ran.err);
        file
    };
    let [a, b, c] = [&files[0], &files[1], &files[2]];
    let (ab, bc) = (merged("ab.json", &[a, b]), merged("bc.json", &[b, c]));
    let all = bytes(&merged("all.json", &[a, b, c]));
    for (name, group) in [
        ("left.json", vec![&ab, c]),
        ("right.json", vec![a, &bc]),
        ("back.json", vec![c, b, a]),
        ("twice.json", vec![&bc, a, &ab, c]),
    ] {
        assert!(bytes(&merged(name, &group)) == all, "{name}");
    }
}

#[test]
fn a_repeated_share_counts_once_and_other_files_are_refused() {
    let folder = scratch("shares-refused");
    let files = shares(&folder, 2, &["test", LEAVES]);
    let again = at(&folder, "again.json");
    let second = ["test", LEAVES, "--shard", "2/2", "--result", &again];
    assert_eq!(anyhit(&second).code, Some(0));
    let twice = merge(&[&files[..], std::slice::from_ref(&again)].concat(), &[]);
    assert_eq!(
        (twice.code, twice.out.ends_with("3 passed\n")),
        (Some(0), true),
        "{}{}",
        twice.out,
        twice.err
    );

    let other = |name: &str, change: &dyn Fn(&mut Value)| {
        let mut value: Value = serde_json::from_slice(&bytes(&files[1])).expect("JSON");
        change(&mut value);
        let path = at(&folder, name);
        std::fs::write(&path, value.to_string()).expect("a writable folder");
        path
    };
    let conflict =
        other("conflict.json", &|value| value["shares"]["2"]["tests"][0]["ended"] = "failed".into());
    let version = other("version.json", &|value| value["anyhit"] = "0.0.1".into());
    let format = other("format.json", &|value| value["anyhit_result"] = 9.into());
    let empty = other("empty.json", &|value| value["shares"] = serde_json::json!({}));
    let beyond =
        other("beyond.json", &|value| value["shares"] = serde_json::json!({ "7": value["shares"]["2"] }));
    let moved = other("moved.json", &|value| value["shares"]["2"]["tests"][0]["place"] = 0.into());
    let cut = other("cut.json", &|value| value["shares"]["2"]["tests"] = serde_json::json!([]));
    let broken = at(&folder, "broken.json");
    std::fs::write(&broken, "no JSON").expect("a writable folder");
    let smoke = at(&folder, "smoke.json");
    let module = "spirv-fixtures/pass/sphere/closest-hit/main.rmiss.spv";
    assert_eq!(anyhit(&["smoke", module, "--shard", "2/2", "--result", &smoke]).code, Some(0));
    let suite = at(&folder, "suite.json");
    let filtered = ["test", LEAVES, "--filter", "leaves::", "--shard", "2/2", "--result", &suite];
    assert_eq!(anyhit(&filtered).code, Some(0));
    let widths = at(&folder, "widths.json");
    let other_flags = ["test", LEAVES, "--all-widths", "--shard", "2/2", "--result", &widths];
    assert_eq!(anyhit(&other_flags).code, Some(0));
    let first = files[0].as_str();
    for (second, words) in [
        (None, vec!["shard 2 of 2 is missing", "--partial"]),
        (Some(conflict.as_str()), vec![&files[1], &conflict, "shard 2 of 2", "with different results"]),
        (Some(&version), vec![&version, "written by anyhit 0.0.1"]),
        (Some(&format), vec![&format, "version 9 of the format"]),
        (Some(&empty), vec![&empty, "contains no results"]),
        (Some(&beyond), vec![&beyond, "the file contains shard 7 of 2"]),
        (Some(&moved), vec!["is in two shards"]),
        (Some(&cut), vec!["all shards together have 2 tests, but the suite has 3"]),
        (Some(&broken), vec![&broken, "not a result that `--result` wrote"]),
        (Some(&smoke), vec![&smoke, "a result of `anyhit smoke`, not of `anyhit test`"]),
        (Some(&suite), vec![&suite, first, "a different run", "`names`"]),
        (Some(&widths), vec![&widths, first, "a different run", "--all-widths"]),
        (Some("no/such/file"), vec!["no/such/file"]),
    ] {
        let mut named = vec![first.to_owned()];
        named.extend(second.map(str::to_owned));
        // A conflict needs the share itself, too.
        if second == Some(&conflict) {
            named.push(files[1].clone());
        }
        let ran = merge(&named, &[]);
        assert_eq!((ran.code, ran.out.as_str()), (Some(2), ""), "{second:?}: {}", ran.err);
        for word in words {
            assert!(ran.err.contains(word), "{second:?}: no {word}: {}", ran.err);
        }
    }
    assert_eq!(anyhit(&["merge"]).code, Some(2));
    let partial = merge(&files[..1], &["--partial"]);
    assert_eq!(partial.code, Some(0), "{}", partial.err);
    assert!(
        partial.err.contains("shard 2 of 2 is missing: the report covers only the others"),
        "{}",
        partial.err
    );
    for (flags, words) in [
        (&["--coverage", "x.lcov"][..], "the shards recorded no coverage"),
        (&["-o", "x.png"], "`--output` applies to results of `anyhit render`"),
    ] {
        let ran = merge(&files, flags);
        assert!(ran.code == Some(2) && ran.err.contains(words), "{}", ran.err);
    }
}

#[test]
fn timings_balance_shares_that_stay_disjoint_and_complete() {
    let folder = scratch("shares-timings");
    let (timings, merged_timings) = (at(&folder, "timings.json"), at(&folder, "merged.json"));
    let tests = ["test", LEAVES, "tests/commands/test-command/trap"];
    let whole = anyhit(&[&tests[..], &["--write-timings", &timings]].concat());
    let known: Value = serde_json::from_slice(&bytes(&timings)).expect("JSON");
    assert_eq!(known.as_object().map(serde_json::Map::len), Some(4), "{known}");
    let files = shares(&folder, 2, &[&tests[..], &["--timings", &timings]].concat());
    let merged = merge(&files, &["--timings", &merged_timings]);
    assert_eq!((merged.out, merged.code), (whole.out, whole.code));
    let names = |path: &str| {
        let value: Value = serde_json::from_slice(&bytes(path)).expect("JSON");
        value.as_object().expect("an object").keys().cloned().collect::<Vec<_>>()
    };
    assert_eq!(names(&timings), names(&merged_timings));
    // One test takes longer than all others: it has a share of its own.
    let rays = ["the sky", "through the hole"].map(|ray| format!("\"{LEAVES}::{ray}\": 1"));
    let launch = format!("{{ \"{LEAVES}\": 100, {}, \"unknown\": 7 }}", rays.join(", "));
    std::fs::write(&timings, launch).expect("a writable folder");
    let list = |shard: &str| {
        let ran = anyhit(&[&tests[..], &["--timings", &timings, "--shard", shard, "--list"]].concat());
        assert_eq!(ran.code, Some(0), "{}", ran.err);
        ran.out.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!((list("1/2"), list("2/2").len()), (vec![LEAVES.to_owned()], 3));
    // Other timings give other shares: these do not belong together.
    let other = at(&folder, "other.json");
    anyhit(&[&tests[..], &["--timings", &timings, "--shard", "2/2", "--result", &other]].concat());
    let ran = merge(&[files[0].clone(), other], &[]);
    assert!(ran.code == Some(2) && ran.err.contains("`timings`"), "{}", ran.err);
    std::fs::write(&timings, "[1]").expect("a writable folder");
    let ran = anyhit(&[&tests[..], &["--timings", &timings, "--shard", "1/2"]].concat());
    assert!(
        ran.code == Some(2) && ran.err.contains("expected an object of seconds by test names"),
        "{}",
        ran.err
    );
}

#[test]
fn drawn_and_perturbed_runs_are_shared_by_tests() {
    let folder = scratch("shares-drawn");
    let unstable = ["test", "shaders/pass/stability", "shaders/pass/any-hit"];
    for flags in [&["--perturb", "3"][..], &["--many-seeds", "4"], &["--sanitize"]] {
        let arguments = [&unstable[..], flags, &["--no-explanation"]].concat();
        let whole = anyhit(&arguments);
        let merged = merge(&shares(&folder, 3, &arguments), &[]);
        assert_eq!((merged.out, merged.code), (whole.out, whole.code), "{flags:?}");
    }
}

/// The runs of a perturbation are numbered, and a range of them draws what these draw.
#[test]
fn a_range_of_perturbed_runs_is_a_share_of_them() {
    let run = |range: &[&str]| {
        let scene = "shaders/pass/stability/unstable-branch/scene.toml";
        let arguments = [&["run", scene, "--perturb", "8", "--json"], range].concat();
        let ran = anyhit(&arguments);
        let found: Value = serde_json::from_str(&ran.out).unwrap_or_else(|error| panic!("{error}: {ran:?}"));
        (found["first_run"].clone(), found["branches"][0]["count"].as_u64().unwrap_or(0))
    };
    let (whole, first, second) = (run(&[]), run(&["--seed-range", "0..4"]), run(&["--seed-range", "4..8"]));
    assert_eq!([&whole.0, &first.0, &second.0], [&Value::from(1), &Value::from(1), &Value::from(5)]);
    assert_eq!(whole.1, first.1 + second.1);
    assert!(whole.1 > 0);
}

#[test]
fn bazel_asks_for_shares_by_its_variables() {
    let folder = scratch("shares-bazel");
    let status = at(&folder, "status");
    let list = |index: &str, of: &str, more: &[&str]| {
        let variables = [
            ("TEST_SHARD_INDEX", index),
            ("TEST_TOTAL_SHARDS", of),
            ("TEST_SHARD_STATUS_FILE", status.as_str()),
        ];
        anyhit_with(&[&["test", LEAVES, "--list"], more].concat(), &variables)
    };
    let mut names: Vec<String> = Vec::new();
    for index in ["0", "1"] {
        names.extend(list(index, "2", &[]).out.lines().map(str::to_owned));
        std::fs::remove_file(&status).expect("Bazel is told that its variables were heeded");
    }
    assert_eq!(names.len(), 3, "{names:?}");
    names.dedup();
    assert_eq!(names.len(), 3, "{names:?}");
    assert_eq!(list("1", "2", &["--shard", "1/1"]).out.lines().count(), 3);
    assert!(!Path::new(&status).exists(), "the flag was heeded, and not the variables");
    for (index, of) in [("2", "2"), ("x", "2"), ("0", ""), ("", "2")] {
        let ran = list(index, of, &[]);
        assert!(ran.code == Some(2) && ran.err.contains("TEST_TOTAL_SHARDS"), "{index} {of}: {}", ran.err);
    }
}

#[cfg(feature = "stress")]
#[test]
fn merged_stress_runs_are_those_of_one_run() {
    let folder = scratch("shares-stress");
    let save = at(&folder, "saved");
    // f32 arithmetic is wrong often: more than ten failures, in each share.
    let float = ["stress", "--cases", "1500", "--seed-range", "3..5", "--precision", "float"];
    let float = [&float[..], &["--no-times", "--save", &save]].concat();
    let exact = ["stress", "--cases", "2500", "--no-times", "--save", &save];
    for (arguments, code) in [(&float[..], 1), (&exact[..], 0)] {
        let whole = anyhit(arguments);
        assert_eq!(whole.code, Some(code), "{}{}", whole.out, whole.err);
        let merged = merge(&shares(&folder, 3, arguments), &["--save", &save]);
        assert_eq!((merged.out, merged.code), (whole.out, whole.code));
    }
    let told = anyhit(&float).out;
    assert!(told.starts_with("seeds 3 to 4, "), "{told}");
    assert_eq!(told.matches("\nsaved as ").count(), 10, "the first ten are told: {told}");
    for (flags, words) in [
        (&["--shard", "1/2"][..], "require `--cases N`"),
        (&["--seed-range", "1..3", "--rays", "5"], "require `--cases N`"),
        (&["--cases", "5", "--rays", "5"], "cannot be used with"),
        (&["scenes/swept-spheres.toml", "--cases", "5"], "cannot be used with a scene file"),
    ] {
        let ran = anyhit(&[&["stress"], flags].concat());
        assert!(ran.code == Some(2) && ran.err.contains(words), "{flags:?}: {}", ran.err);
    }
}

#[cfg(feature = "stress")]
#[test]
fn merged_checks_of_functions_are_those_of_one_run() {
    let folder = scratch("shares-check-math");
    let functions = ["check-math", "--width", "16", "--width", "64", "--samples", "50", "--stride", "10007"];
    let some = [&functions[..], &["--function", "Sin", "--function", "FAdd", "--function", "Exp2"]].concat();
    let whole = anyhit(&[&some[..], &["--no-times"]].concat());
    assert_eq!(whole.code, Some(0), "{}{}", whole.out, whole.err);
    let files = shares(&folder, 2, &some);
    assert_eq!(merge(&files, &[]).out, whole.out);
    let json = anyhit(&[&some[..], &["--no-times", "--json"]].concat());
    assert_eq!(merge(&files, &["--format", "json"]).out, json.out);
    assert!(json.out.contains("\"greatest_error\"") && !json.out.contains("\"time\""), "{}", json.out);
}

#[test]
fn smoke_runs_the_modules_of_folders() {
    let folder = scratch("shares-smoke");
    let (text, nothing) = (at(&folder, "text.spv"), at(&folder, "nothing.spv"));
    std::fs::write(&text, "no module").expect("a writable folder");
    std::fs::write(&nothing, "").expect("a writable folder");
    // Searched for, it would not be found; named, it is compiled.
    let source = at(&folder, "source.wgsl");
    std::fs::write(&source, "not WGSL").expect("a writable folder");
    let hidden = folder.join(".hidden");
    std::fs::create_dir(&hidden).expect("a writable folder");
    std::fs::write(hidden.join("a.spv"), "").expect("a writable folder");
    let folder_name = folder.to_str().expect("UTF-8");
    let modules = ["smoke", "spirv-fixtures/fail/trace", "spirv-fixtures/pass/sphere", folder_name, &source];
    let whole = anyhit(&modules);
    let lines: Vec<&str> = whole.out.lines().collect();
    let count = |word: &str| lines.iter().filter(|line| line.starts_with(&format!("{word}  "))).count();
    let (ok, trap, invalid) = (count("ok"), count("trap"), count("invalid"));
    assert!(ok > 0 && trap > 0, "{}", whole.out);
    assert_eq!((invalid, count("unreadable")), (3, 0), "two files and the source: {}", whole.out);
    assert_eq!(
        lines.last(),
        Some(&&*format!("{} modules: {ok} ok, {trap} trap, {invalid} invalid", lines.len() - 1))
    );
    assert_eq!(whole.code, Some(2), "what is invalid weighs more than a trap");
    assert_eq!(anyhit(&modules[..3]).code, Some(1));
    assert_eq!(anyhit(&[&modules[..], &["--jobs", "1"]].concat()).out, whole.out);
    let (json, files) =
        (anyhit(&[&modules[..], &["--json"]].concat()), shares(&folder_of("smoke-results"), 3, &modules));
    let merged = merge(&files, &[]);
    assert_eq!((merged.out, merged.code), (whole.out, whole.code));
    let merged = merge(&files, &["--format", "json"]);
    assert_eq!((&merged.out, merged.code), (&json.out, json.code));
    let report: Value = serde_json::from_str(&json.out).expect("JSON");
    assert_eq!(report["counts"]["trap"], trap);
    let first = &report["modules"][0];
    let alone = anyhit(&["smoke", first["file"].as_str().expect("a text"), "--json"]);
    let alone: Value = serde_json::from_str(&alone.out).expect("JSON");
    assert_eq!(first["entry_points"], alone["entry_points"]);
    let empty = scratch("shares-smoke-empty");
    let ran = anyhit(&["smoke", empty.to_str().expect("UTF-8")]);
    assert!(ran.code == Some(2) && ran.err.contains("no modules in"), "{}", ran.err);
    let ran = anyhit(&["smoke", "no/such/folder", LEAVES]);
    assert!(
        ran.code == Some(2) && ran.out.starts_with("unreadable  no/such/folder: "),
        "{}{}",
        ran.out,
        ran.err
    );
}

fn folder_of(name: &str) -> std::path::PathBuf {
    scratch(&format!("shares-{name}"))
}

#[test]
fn a_merged_picture_has_the_bytes_of_one_run() {
    let folder = scratch("shares-picture");
    let scene = ["render", "scenes/swept-spheres.toml", "--size", "72x52"];
    // 72 texels a row: batches of 128 end with a row every 16 rows, so there are four bands.
    let files = shares(&folder, 3, &scene);
    for kind in ["png", "raw"] {
        let [whole, merged] = ["whole", "merged"].map(|name| at(&folder, &format!("{name}.{kind}")));
        assert_eq!(anyhit(&[&scene[..], &["-o", &whole]].concat()).code, Some(0));
        let ran = merge(&files, &["-o", &merged]);
        assert_eq!(ran.code, Some(0), "{}", ran.err);
        assert!(bytes(&merged) == bytes(&whole), "{kind}");
    }
    // More shares than bands: some have none.
    let many = shares(&folder_of("picture-many"), 6, &scene);
    let merged = at(&folder, "many.png");
    assert_eq!(merge(&many, &["-o", &merged]).code, Some(0));
    assert!(bytes(&merged) == bytes(&at(&folder, "whole.png")));
    let size =
        shares(&folder_of("picture-size"), 3, &["render", "scenes/swept-spheres.toml", "--size", "72x60"]);
    let ran = merge(&[files[0].clone(), size[1].clone()], &["-o", &merged]);
    assert!(ran.code == Some(2) && ran.err.contains("its `size` is [72,60], not [72,52]"), "{}", ran.err);
}

#[test]
fn a_picture_that_cannot_be_shared_says_why() {
    let folder = scratch("shares-no-picture");
    let file = at(&folder, "1.json");
    let shard = ["--shard", "1/2", "--result", &file];
    let ran = anyhit(&[&["render", "shaders/pass/frames/ping-pong/scene.toml"], &shard[..]].concat());
    assert_eq!(ran.code, Some(2), "{}", ran.err);
    let told = "the picture cannot be divided into shards of rows: the scene runs more than one launch";
    assert!(ran.err.contains(told), "{}", ran.err);
    let scene = ["render", "scenes/swept-spheres.toml"];
    for (flags, words) in [
        (&["--shard", "1/2"][..], "requires `--result FILE`"),
        (&["--result", &file, "-o", "x.png"], "`anyhit merge FILE... -o PICTURE`"),
        (&["--result", &file, "--stats"], "`--stats` requires a whole launch"),
        (&["--result", &file, "--heat", "instructions"], "`--html` cannot be used with"),
    ] {
        let ran = anyhit(&[&scene[..], flags].concat());
        assert!(ran.code == Some(2) && ran.err.contains(words), "{flags:?}: {}", ran.err);
    }
    assert!(!Path::new(&file).exists());
}

/// Results whose JSON is of other types and numbers than those that are written: an error, and
/// never a file outside of the folder for cases.
#[test]
fn results_of_smoke_tests_that_make_no_sense_are_refused() {
    let folder = scratch("shares-smoke-refused");
    let modules = ["main.rchit.spv", "main.rgen.spv", "main.rmiss.spv"]
        .map(|name| format!("spirv-fixtures/pass/sphere/closest-hit/{name}"));
    let smoke = ["smoke", &modules[0], &modules[1], &modules[2]];
    let files = shares(&folder, 2, &smoke);
    let changed = |name: &str, change: &dyn Fn(&mut Value)| {
        let mut value: Value = serde_json::from_slice(&bytes(&files[0])).expect("JSON");
        change(&mut value["shares"]["1"]["modules"]);
        let path = at(&folder, name);
        std::fs::write(&path, value.to_string()).expect("a writable folder");
        path
    };
    for (name, words, change) in [
        (
            "list.json",
            "expected a map",
            &(|modules: &mut Value| modules[0]["json"] = serde_json::json!([])) as &dyn Fn(&mut Value),
        ),
        ("text.json", "expected a map", &|modules| modules[0]["json"] = "x".into()),
        ("number.json", "expected a map", &|modules| modules[1]["json"] = 7.into()),
        ("null.json", "expected a map", &|modules| modules[0]["json"] = Value::Null),
        ("place.json", "module number 18446744073709551615 exceeds the 3", &|modules| {
            modules[0]["place"] = u64::MAX.into()
        }),
        ("twice.json", "is in two shards", &|modules| modules[0]["place"] = 1.into()),
        ("fewer.json", "all shards together have 1 modules", &|modules| *modules = serde_json::json!([])),
    ] {
        let file = changed(name, change);
        for format in ["plain", "json"] {
            let ran = merge(&[file.clone(), files[1].clone()], &["--format", format]);
            assert_eq!(ran.code, Some(2), "{name}: {}{}", ran.out, ran.err);
            assert!(ran.err.contains(words), "{name}: {}", ran.err);
        }
    }
    // A member of another type is passed on, as one that this version does not know.
    let odd =
        changed("odd.json", &|modules| modules[0]["json"] = serde_json::json!({ "file": 3, "verdict": [] }));
    let ran = merge(&[odd, files[1].clone()], &["--format", "json"]);
    assert_eq!(ran.code, Some(0), "{}", ran.err);
    let merged: Value = serde_json::from_str(&ran.out).expect("JSON");
    assert_eq!(merged["modules"][0]["file"], modules[0].as_str());
}

/// The name of a file that a wrong case is saved in is made of its family.
#[test]
#[cfg(feature = "stress")]
fn a_case_of_an_unknown_family_is_saved_nowhere() {
    let folder = scratch("shares-stress-refused");
    let files = shares(&folder, 1, &["stress", "--cases", "1", "--no-times"]);
    let mut value: Value = serde_json::from_slice(&bytes(&files[0])).expect("JSON");
    let failure =
        serde_json::json!({ "seed": 1, "number": 0, "family": "../outside", "failure": "x", "case": "" });
    value["shares"]["1"]["failures"] = serde_json::json!([failure]);
    value["shares"]["1"]["wrong"] = 1.into();
    std::fs::write(&files[0], value.to_string()).expect("a writable folder");
    let cases = at(&folder, "cases");
    let ran = merge(&files, &["--save", &cases]);
    assert_eq!(ran.code, Some(2), "{}{}", ran.out, ran.err);
    assert!(ran.err.contains("the unknown family `../outside`"), "{}", ran.err);
    assert!(!folder.join("outside-1-0.toml").exists() && !Path::new(&cases).exists());
}
