//! Failed tests and findings for GitLab, which shows them at lines.

use serde_json::{Value, json};

use crate::shares::fingerprint;
use crate::suite::{Problem, SuiteResult, TestResult};
use anyhit_base::error::ErrorClass;
use anyhit_base::escape;
use anyhit_base::sorted::SortedMap;
use anyhit_sanitize::Level;

/// The tests that did not pass, each with its problem and the name of its rule. Excludes tests that
/// failed because of findings, which are listed separately.
pub(super) fn failed(result: &SuiteResult) -> impl Iterator<Item = (&TestResult, &Problem, &'static str)> {
    result.tests.iter().filter_map(|test| {
        let problem = test.problem.as_ref()?;
        let rule = match test.class? {
            ErrorClass::Finding => return None,
            ErrorClass::Expectation => "test-failed",
            ErrorClass::Trap => "test-trapped",
            ErrorClass::Unsupported | ErrorClass::Limit | ErrorClass::Other => "test-error",
        };
        Some((test, problem, rule))
    })
}

/// The name of a test and the first line about its failure.
pub(super) fn description(test: &TestResult) -> String {
    let message = test.message.as_deref().unwrap_or_default();
    escape::into_line(format!("{}: {message}", test.name))
}

/// Failed tests and findings as a report of code quality, a JSON array
/// (<https://docs.gitlab.com/ci/testing/code_quality/#code-quality-report-format>).
pub fn gitlab(result: &SuiteResult) -> Value {
    let mut known: SortedMap<String, u32> = SortedMap::new();
    // Lines may move without a change of the fingerprint; those of one report differ.
    let mut issue = |rule: &str, text: &str, severity: &str, path: &str, line: u64| {
        let same = fingerprint([rule, text, path].into_iter());
        let count = known.entry(same.clone()).or_default();
        *count += 1;
        json!({
            "check_name": rule,
            "description": text,
            "fingerprint": fingerprint([same.as_str(), &count.to_string()].into_iter()),
            "severity": severity,
            "location": { "path": escape::line(path), "lines": { "begin": line } },
        })
    };
    let mut issues = Vec::new();
    for (test, problem, rule) in failed(result) {
        let severity = if rule == "test-failed" { "major" } else { "critical" };
        issues.push(issue(rule, &description(test), severity, &problem.path, problem.line.into()));
    }
    for finding in result.findings() {
        let record = finding.record();
        let Some(path) = record.shown_path() else { continue };
        let severity = if record.level == Level::Deny { "major" } else { "minor" };
        // GitLab requires a line, which a module has not.
        let line = record.line.unwrap_or(1) as u64;
        issues.push(issue(&record.rule, &record.message, severity, path, line));
    }
    issues.into()
}
