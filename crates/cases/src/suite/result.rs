//! What a suite found, as a file can hold it: all reports are made of it.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::coverage::Coverage;
use crate::shares::{ShareResult, ShareResults, Timings};
use crate::stability::ShadowFindings;
use crate::suite::kept_finding::KeptFinding;
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorClass, ErrorKind, Result, SourceColumns};
use anyhit_base::sorted::{SortedSet, sort_by_key};

/// What the shares of a suite have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteWhole {
    /// How many tests there are.
    pub tests: usize,
    /// A hash of their names.
    pub names: String,
    /// Whether coverage is recorded.
    pub coverage: bool,
    /// Whether every test runs with f64 shadows, too.
    pub shadow: bool,
    /// How results are perturbed, in words; `None` where they are not.
    pub perturbed: Option<String>,
    /// Whether the sanitizer runs, and with which levels of rules.
    pub sanitize: Option<String>,
    /// The seeds from which choices are drawn, and what is drawn.
    pub many_seeds: Option<String>,
    /// The other options that change what is found.
    pub options: Vec<String>,
    /// A hash of the timings that shares are balanced by.
    pub timings: Option<String>,
}

/// What a suite, or a share of one, has found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteResult {
    /// Every test that was reported, in order.
    pub tests: Vec<TestResult>,
    /// What is known of whole cases, in order.
    pub cases: Vec<CaseResult>,
    /// Tests that did not run, because one before failed.
    pub left_out: usize,
    /// Files that were written anew.
    pub written: Vec<String>,
    /// Coverage, where it was asked for.
    pub coverage: Option<Coverage>,
}

/// What became of a test, and all that reports say of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TestResult {
    /// Its place in the whole suite, from 0.
    pub place: usize,
    /// Its name.
    pub name: String,
    /// The file that it stands in.
    pub file: String,
    /// The path of the file from the root of its repository.
    pub path: String,
    /// How it ended.
    pub ended: Ended,
    /// The first line about a failure, or why it is known to fail.
    pub message: Option<String>,
    /// The most severe class of its errors, where it did not pass.
    pub class: Option<ErrorClass>,
    /// The lines about it in plain text.
    pub text: String,
    /// The place that other tools show, where it did not pass.
    pub problem: Option<Problem>,
    /// What `--format json` has of it.
    pub json: Value,
    /// How long it took.
    pub microseconds: u64,
    /// What the sanitizer found in it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<KeptFinding>,
    /// What its shadows showed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shadow: Option<ShadowFindings>,
    /// Whether it passed and was held to stable outputs.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub held_stable: bool,
}

/// A test that did not pass, at the line that is to blame: of a shader, or of the test's file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// The path of the file from the root of its repository.
    pub path: String,
    /// The line, from 1.
    pub line: u32,
    /// The columns in the line, where they are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<SourceColumns>,
    /// The whole report.
    pub report: String,
}

/// How a test ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// As expected.
    Passed,
    /// It fails, as is known.
    KnownFailure,
    /// Not as expected.
    Failed,
    /// It could not run.
    Error,
    /// Not as expected, and what was expected is written anew.
    Renewed,
}

/// What is known of a case before its tests run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaseResult {
    /// Its place among the cases of the whole suite, from 0.
    pub place: usize,
    /// Notes for its author, a line each: old names that files use.
    pub notes: Vec<String>,
    /// What is undefined before anything runs, as warnings.
    pub findings: Vec<KeptFinding>,
}

impl Ended {
    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::KnownFailure => "known failure",
            Self::Failed => "FAILED",
            Self::Error => "ERROR",
            Self::Renewed => "renewed",
        }
    }
}

impl TestResult {
    /// How long it took.
    pub fn took(&self) -> Duration {
        Duration::from_micros(self.microseconds)
    }
}

impl ShareResult for SuiteResult {
    const COMMAND: &'static str = "test";
    type Whole = SuiteWhole;

    fn without_times(&self) -> Self {
        let tests = self.tests.iter().cloned().map(|test| TestResult { microseconds: 0, ..test });
        Self { tests: tests.collect(), ..self.clone() }
    }
}

impl SuiteResult {
    /// The shares of a suite as one result: tests in the order of the suite, and each case once.
    pub fn of_shares(results: &ShareResults<Self>) -> Self {
        let mut sum = Self::default();
        for share in results.shares() {
            sum.tests.extend(share.tests.iter().cloned());
            for case in &share.cases {
                // The tests of a case may stand in several shares.
                if !sum.cases.iter().any(|known| known.place == case.place) {
                    sum.cases.push(case.clone());
                }
            }
            sum.left_out = sum.left_out.saturating_add(share.left_out);
            sum.written.extend(share.written.iter().cloned());
            if let Some(coverage) = &share.coverage {
                sum.coverage.get_or_insert_default().add(coverage.clone());
            }
        }
        sort_by_key(&mut sum.tests, |test| test.place);
        sort_by_key(&mut sum.cases, |case| case.place);
        sum
    }

    /// Whether the shares of a suite hold each of its tests once.
    ///
    /// # Errors
    /// `InvalidArgument` where one stands in two shares, or in none though no share is missing.
    pub fn check_shares(results: &ShareResults<Self>) -> Result<()> {
        let mut places = SortedSet::new();
        let refuse = |message: String| Err(Error::new(ErrorKind::InvalidArgument, message));
        for test in results.shares().flat_map(|share| &share.tests) {
            if !places.insert(test.place) {
                return refuse(format!("the test `{}` is in two shards", test.name));
            }
        }
        let left_out = results.shares().map(|share| share.left_out).fold(0, usize::saturating_add);
        let (found, all) = (places.len().saturating_add(left_out), results.whole().tests);
        if results.missing().is_empty() && found != all {
            let [found, all] = [found, all].map(grouped);
            return refuse(format!("all shards together have {found} tests, but the suite has {all}"));
        }
        Ok(())
    }

    /// The class of the error that its command ends with; `None` if every test passed.
    pub fn class(&self) -> Option<ErrorClass> {
        self.tests.iter().filter_map(|test| test.class).max()
    }

    /// How many tests ended so.
    pub fn count(&self, ended: Ended) -> usize {
        self.tests.iter().filter(|test| test.ended == ended).count()
    }

    /// What the shadows of all tests showed.
    pub fn shadow(&self) -> ShadowFindings {
        let mut sum = ShadowFindings::default();
        self.tests.iter().filter_map(|test| test.shadow.as_ref()).for_each(|found| sum.add(found));
        sum
    }

    /// How many tests passed and were held to stable outputs.
    pub fn held_stable(&self) -> usize {
        self.tests.iter().filter(|test| test.held_stable).count()
    }

    /// All findings, each once: those of cases, then those of tests.
    pub fn findings(&self) -> Vec<KeptFinding> {
        let mut sum = Vec::new();
        let cases = self.cases.iter().flat_map(|case| &case.findings);
        KeptFinding::add(&mut sum, cases.chain(self.tests.iter().flat_map(|test| &test.findings)));
        sum
    }

    /// The notes of all cases, each once.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = Vec::new();
        for note in self.cases.iter().flat_map(|case| &case.notes) {
            if !notes.contains(note) {
                notes.push(note.clone());
            }
        }
        notes
    }

    /// How long the tests took.
    pub fn timings(&self) -> Timings {
        Timings::of(self.tests.iter().map(|test| (test.name.as_str(), test.microseconds)))
    }
}
