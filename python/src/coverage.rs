//! Coverage of lines and branches of shaders.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use anyhit_base::atomic_file;
use anyhit_cases::coverage::Coverage as Covered;
use anyhit_cases::suite::report;
use anyhit_engine::program::Program;
use anyhit_unit_test::block_counts::BlockCounts;
use pyo3::prelude::*;

use crate::argument;
use crate::copies::never_changes;
use crate::error::{invalid, raised};

/// Coverage of shader sources: lines, branches, functions, and which ways rays went. Coverages add
/// up; they can be pickled.
#[pyclass(frozen, eq, module = "anyhit")]
#[derive(Clone, PartialEq)]
pub(crate) struct Coverage {
    pub(crate) covered: Covered,
}

#[pymethods]
impl Coverage {
    /// A coverage of nothing, or what `json` returned.
    #[new]
    #[pyo3(signature = (json=None))]
    fn new(#[pyo3(from_py_with = argument::json)] json: Option<String>) -> PyResult<Self> {
        let covered = json.map(|json| serde_json::from_str(&json)).transpose();
        let covered = covered.map_err(|error| invalid(format!("json: {error}")))?;
        Ok(Self { covered: covered.unwrap_or_default() })
    }

    /// All of it as JSON, in a form of its own.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string(&self.covered).map_err(|error| invalid(error.to_string()))
    }

    /// Execution counts of lines: a dict by source file of dicts by line.
    #[getter]
    fn lines(&self) -> std::collections::BTreeMap<String, std::collections::BTreeMap<u32, u64>> {
        let of = |(name, file): (&String, &anyhit_cases::coverage::FileCoverage)| {
            (name.clone(), file.lines.iter().map(|(&line, &count)| (line, count)).collect())
        };
        self.covered.files.iter().map(of).collect()
    }

    /// Lines and branches, and what rays did, as `anyhit test --coverage` prints it.
    fn summary(&self) -> String {
        report::coverage(&self.covered)
    }

    /// An lcov tracefile.
    fn lcov(&self) -> String {
        self.covered.lcov()
    }

    /// Writes a file: an lcov tracefile, or XML of Cobertura where its name ends in `.xml`.
    fn write(&self, #[pyo3(from_py_with = argument::path)] path: PathBuf) -> PyResult<()> {
        atomic_file::write(&path, self.covered.text_for(&path)).map_err(raised)
    }

    fn __add__(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        sum.covered.add(other.covered.clone());
        sum
    }

    fn __getnewargs__(&self) -> PyResult<(String,)> {
        Ok((self.json()?,))
    }

    fn __repr__(&self) -> String {
        let [[lines, all], _] = self.covered.totals();
        format!("<anyhit.Coverage: {lines} of {all} lines>")
    }
}

/// Coverage of the tests of single shaders, while it is recorded.
static RECORDED: Mutex<Option<Covered>> = Mutex::new(None);

/// Begins to record what tests of single shaders cover, of sources that are files.
#[pyfunction]
pub(crate) fn _record_coverage() {
    RECORDED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_default();
}

/// Returns what was recorded since the last call; nothing where nothing is recorded.
#[pyfunction]
pub(crate) fn _recorded_coverage() -> Coverage {
    let mut recorded = RECORDED.lock().unwrap_or_else(PoisonError::into_inner);
    Coverage { covered: recorded.as_mut().map(std::mem::take).unwrap_or_default() }
}

/// Runs a test: as it is, or counting where coverage is recorded.
pub(crate) fn counted<T>(
    program: &Program,
    run: impl FnOnce() -> anyhit::Result<T>,
    run_counted: impl FnOnce(&mut BlockCounts) -> anyhit::Result<T>,
) -> anyhit::Result<T> {
    if RECORDED.lock().unwrap_or_else(PoisonError::into_inner).is_none() {
        return run();
    }
    let mut counts = BlockCounts::default();
    let result = run_counted(&mut counts);
    let mut covered = Covered::of_program(program, &counts, "".as_ref());
    covered.without_lines = Default::default();
    covered.files.retain(|name, _| std::path::Path::new(name).is_file());
    if let Some(all) = RECORDED.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
        all.add(covered);
    }
    result
}

never_changes!(Coverage);
