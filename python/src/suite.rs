//! The cases of scene files, one by one: what the plugin for pytest collects and runs.

use std::path::PathBuf;

use anyhit_base::input::RootFolder;
use anyhit_cases::many_seeds::ManySeeds;
use anyhit_cases::shares::Shard;
use anyhit_cases::stability::Perturbation;
use anyhit_cases::suite::{self, Outcome, SuiteOptions};
use anyhit_sanitize::Levels;
use anyhit_scene::SceneFiles;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

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
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
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
    #[pyo3(signature = (at, *, sanitize=false, many_seeds=None, perturb=None, all_widths=false, explanation=true, pictures=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn run(
        &self,
        py: Python<'_>,
        at: usize,
        sanitize: bool,
        many_seeds: Option<u64>,
        perturb: Option<u32>,
        all_widths: bool,
        explanation: bool,
        pictures: Option<PathBuf>,
    ) -> PyResult<Finished> {
        let count = self.suite.tests().len();
        if at >= count {
            return Err(PyIndexError::new_err(format!("there is no test {at} of {count}")));
        }
        let mut one = self.suite.clone();
        one.shard(Shard { number: at + 1, of: count }, None);
        let options = SuiteOptions {
            jobs: 1,
            sanitize: sanitize.then(Levels::default),
            many_seeds: many_seeds.map(|seeds| ManySeeds { seeds: 0..seeds, ..ManySeeds::default() }),
            perturb: perturb.map(|runs| Perturbation { runs, ..Perturbation::default() }),
            all_widths,
            no_explanation: !explanation,
            pictures: pictures.unwrap_or_else(|| std::env::temp_dir().join("anyhit-test")),
            ..SuiteOptions::default()
        };
        let (outcome, text) = run(py, || {
            let mut found = None;
            one.run(&options, &mut |finished, test| {
                let outcome = match &finished.outcome {
                    Outcome::Passed | Outcome::Renewed => ("passed", String::new()),
                    Outcome::KnownFailure(why) => ("known failure", why.clone()),
                    Outcome::Failed(_) => ("failed", test.text.clone()),
                    Outcome::Broken(_) => ("error", test.text.clone()),
                };
                found = Some(outcome);
                Ok(())
            })?;
            Ok(found.unwrap_or_default())
        })?;
        Ok(Finished { outcome: outcome.to_owned(), text })
    }
}

/// What became of a test.
#[pyclass(frozen, get_all, module = "anyhit")]
pub(crate) struct Finished {
    /// "passed", "failed", "error" where it could not run, or "known failure".
    outcome: String,
    /// The report of a failure, or why it is known to fail.
    text: String,
}
