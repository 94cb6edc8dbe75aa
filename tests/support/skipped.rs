//! Tests that need more than Rust: where a tool is missing they do not pass without a word.

use std::fmt::Display;
use std::io::Write;
use std::process::Command;

use anyhit_compile::{Language, tool};

/// The path of the test that this stands in, as `cargo test` prints it.
macro_rules! test_name {
    () => {{
        fn here() {}
        let path = std::any::type_name_of_val(&here).trim_end_matches("::here");
        path.split_once("::").map_or(path, |(_crate, path)| path)
    }};
}
pub(crate) use test_name;

/// Says that a test, or a part of it, did not run, and why. The line goes past the capture of the
/// test harness, which shows what tests print only where they fail, and `.ci/run` lists it.
pub fn skipped(test: &str, why: impl Display) {
    // In one piece, as other threads write, too. Without standard error nobody is there to be told.
    let _ = std::io::stderr().write_all(format!("SKIPPED: {test}: {why}\n").as_bytes());
}

/// Whether there is `slangc`; where not, `test` is skipped.
pub fn has_slangc(test: &str) -> bool {
    let found = tool(Language::Slang);
    if let Err(error) = &found {
        skipped(test, error.message());
    }
    found.is_ok()
}

/// Whether all of these programs run; where not, `test` is skipped.
pub fn has_programs(test: &str, programs: &[&str]) -> bool {
    let runs = |program: &&&str| {
        let output = Command::new(program).arg("--version").output();
        output.is_ok_and(|output| output.status.success())
    };
    let missing: Vec<&str> = programs.iter().filter(|program| !runs(program)).copied().collect();
    if !missing.is_empty() {
        skipped(test, format_args!("{} is not installed", missing.join(", ")));
    }
    missing.is_empty()
}

/// Returns true if this process ignores a signal, and so do its children: a shell without job
/// control ignores SIGINT for background commands. Only Linux reports it.
pub fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// The value of an environment variable; where it is not set, `test` is skipped.
pub fn variable(test: &str, name: &str) -> Option<String> {
    let value = std::env::var(name).ok().filter(|value| !value.is_empty());
    if value.is_none() {
        skipped(test, format_args!("{name} is not set (CONTRIBUTING.md)"));
    }
    value
}

#[test]
fn a_test_is_named_as_the_harness_names_it() {
    assert_eq!(test_name!(), "support::skipped::a_test_is_named_as_the_harness_names_it");
}
