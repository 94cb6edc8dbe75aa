//! The cases of scene files, one by one: what the plugin for pytest collects and runs.

use std::path::PathBuf;

use anyhit::Error;
use anyhit_base::input::RootFolder;
use anyhit_cases::many_seeds::ManySeeds;
use anyhit_cases::shares::Shard;
use anyhit_cases::stability::Perturbation;
use anyhit_cases::suite::{self, Outcome, SuiteOptions};
use anyhit_sanitize::Levels;
use anyhit_scene::SceneFiles;
use pyo3::prelude::*;

use crate::argument;
use crate::copies::never_changes;
use crate::coverage::Coverage;
use crate::error::{invalid, span};
use crate::run::run;

/// The tests of a scene file, or of a folder: its launch, and each of its rays that expects
/// something.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct Suite {
    suite: suite::Suite,
}

#[pymethods]
impl Suite {
    /// Finds the tests of a `scene.toml`, a `*.test.toml`, or all beneath a folder.
    #[new]
    fn new(py: Python<'_>, #[pyo3(from_py_with = argument::path)] path: PathBuf) -> PyResult<Self> {
        let suite = run(py, || {
            suite::Suite::find_within(&[path], &|file, tree| {
                let root = Some(RootFolder::of_test(file, tree)?);
                Ok(SceneFiles { root, ..SceneFiles::default() })
            })
        })?;
        Ok(Self { suite })
    }

    /// The names of the tests, in order.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.suite.tests().iter().map(|test| test.name.clone()).collect()
    }

    /// Runs the test at a place in the order. With `sanitize`, `many_seeds` or `perturb` one that
    /// passes runs again as `anyhit test` with these options runs it.
    /// `coverage` records what its shaders cover.
    #[pyo3(signature = (at, *, sanitize=false, many_seeds=None, perturb=None, all_widths=false, explanation=true, pictures=None, coverage=false))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn run(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::at)] at: usize,
        #[pyo3(from_py_with = argument::sanitize)] sanitize: bool,
        #[pyo3(from_py_with = argument::many_seeds)] many_seeds: Option<u64>,
        #[pyo3(from_py_with = argument::perturb)] perturb: Option<u32>,
        #[pyo3(from_py_with = argument::all_widths)] all_widths: bool,
        #[pyo3(from_py_with = argument::explanation)] explanation: bool,
        #[pyo3(from_py_with = argument::pictures)] pictures: Option<PathBuf>,
        #[pyo3(from_py_with = argument::coverage)] coverage: bool,
    ) -> PyResult<Finished> {
        let count = self.suite.tests().len();
        if at >= count {
            return Err(invalid(format!("at: no test {at}: the suite has {count}")));
        }
        let mut one = self.suite.clone();
        one.shard(Shard { number: at + 1, of: count }, None);
        let options = SuiteOptions {
            jobs: 1,
            sanitize: sanitize.then(Levels::default),
            many_seeds: many_seeds.map(|seeds| ManySeeds { seeds: 0..seeds, ..ManySeeds::default() }),
            perturb: perturb.map(|runs| Perturbation { runs, ..Perturbation::default() }),
            all_widths,
            coverage,
            no_explanation: !explanation,
            pictures: pictures.unwrap_or_else(|| std::env::temp_dir().join("anyhit-test")),
            ..SuiteOptions::default()
        };
        run(py, || {
            let mut found = None;
            let result = one.run(&options, &mut |finished, test| {
                let outcome = match &finished.outcome {
                    Outcome::Passed | Outcome::Renewed => Finished::new("passed", "", &[]),
                    Outcome::KnownFailure(why) => Finished::new("known failure", why, &[]),
                    Outcome::Failed(failure) => Finished::new("failed", &test.text, &failure.errors),
                    Outcome::Broken(error) => Finished::new("error", &test.text, std::slice::from_ref(error)),
                };
                found = Some(outcome);
                Ok(())
            })?;
            let found = found.unwrap_or_else(|| Finished::new("passed", "", &[]));
            let coverage = result.coverage.map(|covered| Coverage { covered });
            Ok(Finished { coverage, ..found })
        })
    }
}

/// The end of a test.
#[pyclass(frozen, get_all, module = "anyhit")]
pub(crate) struct Finished {
    /// "passed", "failed", "error" where it could not run, or "known failure".
    outcome: String,
    /// The report of a failure, or why it is known to fail.
    text: String,
    /// The first difference or mistake in one line; empty where there is none.
    reason: String,
    /// File and line of it, where they are known.
    place: Option<(String, u32)>,
    /// Coverage of its shaders, if it was recorded.
    coverage: Option<Coverage>,
}

impl Finished {
    fn new(outcome: &str, text: &str, errors: &[Error]) -> Self {
        let reason = errors.first().map(|error| without_bits(error.message())).unwrap_or_default();
        let more = match errors.len() {
            0 | 1 => String::new(),
            count => format!(" (and {} more)", count - 1),
        };
        let places = errors.iter().flat_map(Error::places);
        let place = places.filter_map(|(place, _)| span(place)).map(|(file, line, _)| (file, line)).next();
        Self {
            outcome: outcome.to_owned(),
            text: text.to_owned(),
            reason: reason + &more,
            place,
            coverage: None,
        }
    }
}

#[pymethods]
impl Finished {
    fn __repr__(&self) -> String {
        let Self { outcome, reason, .. } = self;
        format!("<anyhit.Finished: {outcome}{}{reason}>", if reason.is_empty() { "" } else { ": " })
    }
}

/// A message without the bits of its numbers: ` (bits 0x3f000000)`.
fn without_bits(message: &str) -> String {
    let mut parts = message.split(" (bits 0x");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + part.split_once(')').map_or(part, |(_, rest)| rest))
}

never_changes!(Suite, Finished);
