//! Adversarial rays, judged by an exact reference: shares of what `anyhit stress` draws.

use std::ops::Range;

use anyhit_base::interrupt::Interrupt;
use anyhit_base::threads::map_on_threads;
use anyhit_engine::geometry::Precision;
use anyhit_stress::judge::{Failure, Tally, check_caught};
use anyhit_stress::minimise::minimise;
use anyhit_stress::{StressCase, case};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::argument;
use crate::error::invalid;
use crate::run::interruptible;

/// Draws the cases `first` to `end` (not included) of a seed, which are the same on every machine,
/// and compares every answer with rational arithmetic. Returns the counts, and the wrong answers,
/// which are made smaller: `number`, `family`, `what`, and `case`, a file that the stress tests
/// replay. The counts of two ranges add up to those of both.
#[pyfunction]
pub(crate) fn stress(
    py: Python<'_>,
    #[pyo3(from_py_with = argument::seed)] seed: u64,
    #[pyo3(from_py_with = argument::first)] first: u64,
    #[pyo3(from_py_with = argument::end)] end: u64,
) -> PyResult<Bound<'_, PyDict>> {
    if first > end {
        return Err(invalid(format!("cases {first} to {end}: the first is beyond the last")));
    }
    let (total, wrong) = interruptible(py, || judge(seed, first..end))?;
    let failures = PyList::empty(py);
    for (number, (case, failure)) in wrong {
        let dict = PyDict::new(py);
        dict.set_item("number", number)?;
        dict.set_item("family", &case.family)?;
        dict.set_item("what", failure.to_string())?;
        dict.set_item("case", case.to_toml())?;
        failures.append(dict)?;
    }
    let Tally { rays, lines, hits, culled, trees, packets } = total;
    let report = PyDict::new(py);
    report.set_item("cases", end - first)?;
    report.set_item("lines", lines)?;
    report.set_item("rays", rays)?;
    report.set_item("hits", hits)?;
    report.set_item("culled", culled)?;
    report.set_item("trees", trees)?;
    report.set_item("packets", packets)?;
    report.set_item("failures", failures)?;
    Ok(report)
}

/// The number of a case that was answered wrongly, made smaller.
type WrongCase = (u64, (StressCase, Failure));

/// The cases that run before their counts are added.
const ROUND: u64 = 1024;

/// The counts of a range of cases, and those that were answered wrongly, made smaller.
fn judge(seed: u64, mut cases: Range<u64>) -> (Tally, Vec<WrongCase>) {
    let precision = Precision::Exact;
    let (mut total, mut wrong) = (Tally::default(), Vec::new());
    let is_interrupted = || Interrupt::current().is_some_and(|interrupt| interrupt.is_raised());
    while !cases.is_empty() && !is_interrupted() {
        let first = cases.start;
        cases.start = cases.end.min(first + ROUND);
        let judged = map_on_threads((cases.start - first) as usize, |at| {
            let number = first + at as u64;
            if is_interrupted() {
                return Ok(Tally::default());
            }
            check_caught(&case(seed, number), precision)
                .map_err(|_| Box::new((number, minimise(&case(seed, number), precision))))
        });
        for result in judged {
            match result {
                Ok(tally) => total = total.plus(&tally),
                Err(failure) => wrong.push(*failure),
            }
        }
    }
    (total, wrong)
}
