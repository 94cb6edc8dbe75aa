//! What `anyhit check-math` finds in a share of the functions and widths.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::shares::results::{ShareResult, ShareResults};
use anyhit_base::sorted::sort_by_key;
use anyhit_stress::check_math::CheckMathReport;

/// What the shares of a run have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckMathWhole {
    /// One input in so many is tested.
    pub stride: u64,
    /// The number of pairs of f32.
    pub pairs: u64,
    /// The number of f64.
    pub samples: u64,
    /// The seed.
    pub seed: u64,
    /// The functions with their widths, in order.
    pub functions: Vec<String>,
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckMathResult {
    /// The functions that were checked, by their places in the whole run.
    pub functions: Vec<(usize, CheckMathReport)>,
}

impl CheckMathResult {
    /// The shares of a run as one result.
    pub fn of_shares(results: &ShareResults<Self>) -> Self {
        let mut functions: Vec<_> =
            results.shares().flat_map(|share| share.functions.iter().cloned()).collect();
        sort_by_key(&mut functions, |(place, _)| *place);
        Self { functions }
    }

    /// The reports in order.
    pub fn reports(&self) -> impl Iterator<Item = &CheckMathReport> {
        self.functions.iter().map(|(_, report)| report)
    }
}

impl ShareResult for CheckMathResult {
    const COMMAND: &'static str = "check-math";
    type Whole = CheckMathWhole;

    fn without_times(&self) -> Self {
        let functions = self.functions.iter().cloned();
        let without = |(place, report)| (place, CheckMathReport { time: Duration::ZERO, ..report });
        Self { functions: functions.map(without).collect() }
    }
}
