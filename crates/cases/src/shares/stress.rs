//! What `anyhit stress` finds in a share of a fixed number of cases.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::shares::results::{ShareResult, ShareResults};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::sorted::sort_by_key;
use anyhit_stress::family::FAMILIES;
use anyhit_stress::{MAX_FAILURES, StressReport, Tally};

/// What the shares of a run have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StressWhole {
    /// The first seed, and that behind the last.
    pub seeds: [u64; 2],
    /// The number of cases of each seed; `None` where something else ends the run.
    pub cases: Option<u64>,
    /// The precision that is tested.
    pub precision: String,
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StressResult {
    /// The number of cases.
    pub cases: u64,
    /// The counts of each family.
    pub families: Vec<Tally>,
    /// How many cases had a wrong result.
    pub wrong: u64,
    /// The first of them by seed and number.
    pub failures: Vec<StressFailure>,
    /// How long it took.
    pub microseconds: u64,
}

/// A case with a wrong result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StressFailure {
    /// The seed.
    pub seed: u64,
    /// The case's number for the seed.
    pub number: u64,
    /// The family that generated it.
    pub family: String,
    /// What is wrong.
    pub failure: String,
    /// The minimised case, as TOML.
    pub case: String,
}

impl StressResult {
    /// The result of a run.
    pub fn of(report: &StressReport) -> Self {
        let failures = report.failures.iter().map(|found| StressFailure {
            seed: found.seed,
            number: found.number,
            family: found.case.family.clone(),
            failure: found.failure.to_string(),
            case: found.case.to_toml(),
        });
        Self {
            cases: report.cases,
            families: report.families.clone(),
            wrong: report.wrong,
            failures: failures.collect(),
            microseconds: u64::try_from(report.time.as_micros()).unwrap_or(u64::MAX),
        }
    }

    /// Whether the failures of shares are of families that there are: a failure's family is part of
    /// the name of the file that it is saved in.
    ///
    /// # Errors
    /// `InvalidArgument` where one is not.
    pub fn check_shares(results: &ShareResults<Self>) -> Result<()> {
        let mut failures = results.shares().flat_map(|share| &share.failures);
        let is_known = |found: &StressFailure| FAMILIES.iter().any(|family| family.name == found.family);
        match failures.find(|found| !is_known(found)) {
            None => Ok(()),
            Some(unknown) => {
                let message = format!("a case has the unknown family `{}`", unknown.family);
                Err(Error::new(ErrorKind::InvalidArgument, message))
            }
        }
    }

    /// The shares of a run as one result.
    pub fn of_shares(results: &ShareResults<Self>) -> Self {
        let mut sum = Self { families: vec![Tally::default(); FAMILIES.len()], ..Self::default() };
        for share in results.shares() {
            sum.cases = sum.cases.saturating_add(share.cases);
            for (family, more) in sum.families.iter_mut().zip(&share.families) {
                *family = family.plus(more);
            }
            sum.wrong = sum.wrong.saturating_add(share.wrong);
            sum.failures.extend(share.failures.iter().cloned());
            sum.microseconds = sum.microseconds.saturating_add(share.microseconds);
        }
        sort_by_key(&mut sum.failures, |found| (found.seed, found.number));
        sum.failures.truncate(MAX_FAILURES);
        sum
    }

    /// The tally of all families together.
    pub fn total(&self) -> Tally {
        self.families.iter().fold(Tally::default(), |sum, one| sum.plus(one))
    }

    /// How long it took.
    pub fn time(&self) -> Duration {
        Duration::from_micros(self.microseconds)
    }
}

impl ShareResult for StressResult {
    const COMMAND: &'static str = "stress";
    type Whole = StressWhole;

    fn without_times(&self) -> Self {
        Self { microseconds: 0, ..self.clone() }
    }
}
