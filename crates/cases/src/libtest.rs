//! Folders of cases as the tests of an executable: `anyhit::cases!`.

use std::path::PathBuf;
use std::process::ExitCode;

use libtest_mimic::{Arguments, Failed, Trial};

use crate::suite::{Ended, Suite, SuiteOptions};
use anyhit_base::error::Result;

/// Makes an executable of which each case beneath some folders is a test, so that `cargo test` and
/// `cargo nextest` list, filter and run them one by one.
///
/// Paths are from the package's folder. The target has no harness of its own, in `Cargo.toml`:
///
/// ```toml
/// [dev-dependencies]
/// anyhit = { version = "0.1", features = ["libtest"] }
///
/// [[test]]
/// name = "shaders"
/// harness = false
/// ```
///
/// and `tests/shaders.rs` is one line:
///
/// ```no_run
/// anyhit::cases!("shaders", "more/cases");
/// ```
#[macro_export]
macro_rules! cases {
    ($($folder:expr),+ $(,)?) => {
        fn main() -> ::std::process::ExitCode {
            $crate::libtest::run_cases(&[$($folder),+])
        }
    };
}

/// Runs the cases beneath folders or in files as `cargo test` runs tests, by the arguments of the
/// process: what [`cases!`](crate::cases) expands to.
///
/// A case passes where its launch and all of its rays do. The process fails where one does not, and
/// where a folder has none or cannot be read.
pub fn run_cases(paths: &[&str]) -> ExitCode {
    let arguments = Arguments::from_args();
    let trials = trials(paths).unwrap_or_else(|error| {
        // What cannot be read is a test that fails, so that every runner shows why.
        let message = error.render();
        vec![Trial::test(paths.join(", "), move || Err(Failed::from(message)))]
    });
    libtest_mimic::run(&arguments, trials).exit_code()
}

fn trials(paths: &[&str]) -> Result<Vec<Trial>> {
    let mut trials = Vec::new();
    for &path in paths {
        let suite = Suite::find(&[PathBuf::from(path)])?;
        let cases = suite.by_case();
        if cases.is_empty() {
            let message = format!("`{path}` has no `scene.toml` and no `*.test.toml` with a test");
            trials.push(Trial::test(path, move || Err(Failed::from(message))));
        }
        trials.extend(cases.into_iter().map(|(name, case)| Trial::test(name, move || check(&case))));
    }
    Ok(trials)
}

/// Runs a case; says of each of its tests that does not pass what `anyhit test` says.
fn check(case: &Suite) -> std::result::Result<(), Failed> {
    let pictures = std::env::temp_dir().join("anyhit-test");
    let options = SuiteOptions { jobs: 1, pictures, ..SuiteOptions::default() };
    let run = case.run(&options, &mut |_, _| Ok(())).map_err(|error| Failed::from(error.render()))?;
    let failed = run.tests.iter().filter(|test| matches!(test.ended, Ended::Failed | Ended::Error));
    let text: String = failed.map(|test| test.text.as_str()).collect();
    if text.is_empty() { Ok(()) } else { Err(Failed::from(text)) }
}
