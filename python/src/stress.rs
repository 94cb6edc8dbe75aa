//! Adversarial rays, judged by an exact reference: shares of what `anyhit stress` draws.

use anyhit_engine::geometry::Precision;
use anyhit_stress::judge::check_caught;
use anyhit_stress::minimise::minimise;
use anyhit_stress::{Tally, case};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::prelude::*;

use crate::error::invalid;

/// Draws the cases `first` to `end` (not included) of a seed, which are the same on every machine,
/// and compares every answer with rational arithmetic. Returns the counts, and the wrong answers,
/// which are made smaller: `number`, `family`, `what`, and `case`, a file that the stress tests
/// replay. The counts of two ranges add up to those of both.
#[pyfunction]
pub(crate) fn stress(py: Python<'_>, seed: u64, first: u64, end: u64) -> PyResult<Bound<'_, PyDict>> {
    if first > end {
        return Err(invalid(format!("cases {first} to {end}: the first is beyond the last")));
    }
    let precision = Precision::Exact;
    let results: Vec<_> = py.detach(|| {
        let judged = |number| match check_caught(&case(seed, number), precision) {
            Ok(tally) => Ok(tally),
            Err(_) => Err(Box::new((number, minimise(&case(seed, number), precision)))),
        };
        (first..end).into_par_iter().map(judged).collect()
    });
    let (mut total, failures) = (Tally::default(), PyList::empty(py));
    for result in results {
        match result {
            Ok(tally) => total = total.plus(&tally),
            Err(wrong) => {
                let (number, (case, failure)) = *wrong;
                let dict = PyDict::new(py);
                dict.set_item("number", number)?;
                dict.set_item("family", &case.family)?;
                dict.set_item("what", failure.to_string())?;
                dict.set_item("case", case.to_toml())?;
                failures.append(dict)?;
            }
        }
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
