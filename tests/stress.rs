//! Replays the cases that `anyhit stress` once found wrong, and runs the command.

use std::path::Path;
use std::process::Command;

use anyhit::internals::geometry::Precision;
use anyhit::internals::stress::{StressCase, check};

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
