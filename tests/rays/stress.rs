//! Replays the cases that `anyhit stress` once found wrong, and runs the command.

use std::path::Path;
use std::process::Command;

use anyhit_cases::case::Case;
use anyhit_engine::geometry::Precision;
use anyhit_scene::{DiskFiles, LoadOptions, load};
use anyhit_stress::scene::run;
use anyhit_stress::{StressCase, StressSettings, check};
use rayon::prelude::*;

#[test]
fn what_was_wrong_once_is_right_now() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/stress-regressions");
    let mut replayed = 0;
    for entry in std::fs::read_dir(&folder).expect("the folder") {
        let path = entry.expect("an entry").path();
        let text = std::fs::read_to_string(&path).expect("a file");
        let case = StressCase::from_toml(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        if let Err(failure) = check(&case, Precision::Exact) {
            panic!("{}: {failure}", path.display());
        }
        replayed += 1;
    }
    assert!(replayed > 0, "no cases in {}", folder.display());
}

#[test]
fn structures_of_all_cases_are_traversed_as_by_the_trees_of_another_builder() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut cases = Case::discover(&root.join("shaders/pass")).expect("the cases' scene files");
    cases.extend(Case::of(&root.join("scenes/swept-spheres.toml")).expect("a scene"));
    cases.dedup_by(|one, other| one.scene == other.scene);
    let settings = StressSettings { seed: 1, rays: Some(500), time: None, precision: Precision::Exact };
    let judged = cases.par_iter().map(|case| {
        let scene = load(&case.scene, &DiskFiles, &LoadOptions::default()).expect("a scene");
        let report = run(&scene.tlas, &settings, |_| ());
        if let Some(failure) = report.failures.first() {
            panic!("{}: {failure}", case.scene.display());
        }
        (report.tally.rays.min(1), report.tally.trees.min(1), report.tally.packets.min(1))
    });
    let (rays, trees, packets) = judged.reduce(|| (0, 0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
    // So many scenes have a structure, one with a tree, one whose rays stay together.
    assert!(rays >= 50 && trees >= 3 && packets >= 10, "{rays}, {trees}, {packets}");
}

#[test]
fn the_command_judges_a_scene() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let run = |scene: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
        command
            .args(["stress", scene, "--rays", "5000"])
            .current_dir(root)
            .output()
            .expect("the command runs")
    };
    let ran = run("scenes/swept-spheres.toml");
    let text = String::from_utf8_lossy(&ran.stdout);
    let told = "\n0 wrong answers, compared with BVHs that obvhs builds of the same primitives\n";
    assert!(ran.status.success() && text.ends_with(told), "{text}");
    for other in ["scenes/none.toml", "shaders/pass/matrices/products/scene.toml"] {
        assert_eq!(run(other).status.code(), Some(2), "{other}");
    }
}

#[test]
fn the_command_tells_what_it_found() {
    let folder = std::env::temp_dir().join(format!("anyhit-stress-{}", std::process::id()));
    let run = |precision: &str| {
        Command::new(env!("CARGO_BIN_EXE_anyhit"))
            .args(["stress", "--seed", "3", "--rays", "1", "--precision", precision, "--save"])
            .arg(&folder)
            .output()
            .expect("the command runs")
    };
    let exact = run("exact");
    let text = String::from_utf8_lossy(&exact.stdout);
    assert!(exact.status.success() && text.contains(" 0 wrong decisions"), "{text}");
    assert!(!folder.exists(), "nothing was wrong, nothing is saved");
    let float = run("float");
    let text = String::from_utf8_lossy(&float.stdout);
    assert_eq!(float.status.code(), Some(1), "{text}");
    // Each failure is saved as a file that can be read again, and fails again.
    let mut saved = 0;
    for entry in std::fs::read_dir(&folder).expect("cases are saved") {
        let text = std::fs::read_to_string(entry.expect("an entry").path()).expect("a file");
        let case = StressCase::from_toml(&text).expect("a case");
        assert!(check(&case, Precision::Float).is_err(), "{text}");
        saved += 1;
    }
    assert_eq!(saved, 10);
    std::fs::remove_dir_all(&folder).expect("the folder goes away");
}
