//! Findings and failed tests as SARIF 2.1.0, for code scanning
//! (<https://docs.oasis-open.org/sarif/sarif/v2.1.0/sarif-v2.1.0.html>).

use serde_json::{Value, json};

use crate::shares::fingerprint;
use crate::suite::SuiteResult;
use crate::suite::for_tools::{description, failed};
use anyhit_base::error::SourceColumns;
use anyhit_base::escape;
use anyhit_base::sorted::SortedMap;
use anyhit_sanitize::rule;
use anyhit_sanitize::{FindingRecord, Level};

/// The rules that a failed test breaks, and what they require.
const TEST_RULES: [(&str, &str); 3] = [
    ("test-failed", "A test has the values that it expects"),
    ("test-trapped", "No shader of a test traps unless the test expects it"),
    ("test-error", "A test can run"),
];

/// The property of `partialFingerprints` (3.27.17). Its version changes with what it is made of.
const FINGERPRINT: &str = "anyhitResult/v1";

/// Findings of a run, as the text of a SARIF file.
pub fn findings_sarif(findings: &[FindingRecord]) -> String {
    let mut log = SarifLog::new(&[]);
    findings.iter().for_each(|finding| log.add_finding(finding));
    log.text()
}

/// Failed tests of a suite and its findings, as the text of a SARIF file.
pub fn suite_sarif(result: &SuiteResult) -> String {
    let mut log = SarifLog::new(&TEST_RULES);
    for (test, problem, rule) in failed(result) {
        log.add(SarifResult {
            rule,
            level: Level::Deny,
            message: description(test),
            path: Some(&problem.path),
            line: Some(problem.line.into()),
            columns: problem.columns,
            properties: None,
        });
    }
    result.findings().iter().for_each(|finding| log.add_finding(finding.record()));
    log.text()
}

/// A result of a log.
struct SarifResult<'a> {
    rule: &'a str,
    level: Level,
    message: String,
    path: Option<&'a str>,
    line: Option<u64>,
    columns: Option<SourceColumns>,
    properties: Option<Value>,
}

/// A log with one run of this program.
struct SarifLog {
    rules: Vec<Value>,
    results: Vec<Value>,
    /// Number of results with the same rule, message and file.
    known: SortedMap<String, u32>,
}

impl SarifLog {
    /// A log with the rules of the sanitizer, after others.
    fn new(others: &[(&str, &str)]) -> Self {
        let others = others.iter().map(|(id, requirement)| {
            json!({
                "id": id,
                "shortDescription": { "text": requirement },
                "defaultConfiguration": { "level": level_name(Level::Deny) },
            })
        });
        let own = rule::all().chain(rule::of_stops()).map(|rule| {
            json!({
                "id": rule.id,
                "shortDescription": { "text": rule.holds },
                "fullDescription": { "text": rule.source },
                "help": { "text": rule.help },
                "defaultConfiguration": { "level": level_name(rule.kind.default_level()) },
            })
        });
        Self { rules: others.chain(own).collect(), results: Vec::new(), known: SortedMap::new() }
    }

    fn add_finding(&mut self, finding: &FindingRecord) {
        self.add(SarifResult {
            rule: &finding.rule,
            level: finding.level,
            message: finding.message.clone(),
            path: finding.shown_path(),
            line: finding.line.map(|line| line as u64),
            columns: finding.columns,
            properties: Some(json!({
                "class": finding.class,
                "count": finding.count,
                "launchId": finding.launch_id,
                "module": finding.module,
            })),
        });
    }

    fn add(&mut self, result: SarifResult<'_>) {
        let SarifResult { rule, level, message, path, line, columns, properties } = result;
        // A line may move without a change of the fingerprint; those of one log differ.
        let same = fingerprint([rule, &message, path.unwrap_or_default()].into_iter());
        let count = self.known.entry(same.clone()).or_default();
        *count += 1;
        let own = fingerprint([same.as_str(), &count.to_string()].into_iter());
        let mut json = json!({
            "ruleId": rule,
            "level": level_name(level),
            "message": { "text": message },
            "partialFingerprints": { FINGERPRINT: own },
        });
        if let Some(index) = self.rules.iter().position(|known| known["id"] == rule) {
            json["ruleIndex"] = index.into();
        }
        if let Some(path) = path {
            json["locations"] = json!([location(path, line, columns)]);
        }
        if let Some(properties) = properties {
            json["properties"] = properties;
        }
        self.results.push(json);
    }

    fn text(self) -> String {
        let log = json!({
            "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
            "version": "2.1.0",
            "runs": [{
                "tool": { "driver": {
                    "name": "anyhit",
                    "version": env!("CARGO_PKG_VERSION"),
                    "rules": self.rules,
                } },
                "columnKind": "unicodeCodePoints",
                "results": self.results,
            }],
        });
        format!("{log:#}\n")
    }
}

/// A part of a line of a file, the whole line, or the whole file where it has no lines.
fn location(path: &str, line: Option<u64>, columns: Option<SourceColumns>) -> Value {
    let mut place = json!({ "artifactLocation": { "uri": uri(path) } });
    if let Some(line) = line {
        place["region"] = json!({ "startLine": line });
        if let Some(SourceColumns { start, end }) = columns {
            place["region"]["startColumn"] = start.into();
            if let Some(end) = end {
                place["region"]["endColumn"] = end.into();
            }
        }
    }
    json!({ "physicalLocation": place })
}

/// A path as SARIF has it (3.4.3): relative to the repository's root, or of the file system.
fn uri(path: &str) -> String {
    match path.starts_with('/') {
        true => format!("file://{}", escape::uri(path)),
        false => escape::uri(path),
    }
}

fn level_name(level: Level) -> &'static str {
    match level {
        Level::Deny => "error",
        Level::Warn => "warning",
        Level::Allow => "none",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(path: Option<&str>, line: Option<usize>, columns: Option<SourceColumns>) -> FindingRecord {
        FindingRecord {
            rule: "pow-domain".into(),
            level: Level::Deny,
            kind: "undefined value".into(),
            class: "bug".into(),
            message: "pow(-1.0, 2.0)".into(),
            file: None,
            path: path.map(str::to_owned),
            module: Some("sky.spv".into()),
            line,
            columns,
            count: 3,
            launch_id: [3, 2, 0],
            stack: Vec::new(),
            notes: Vec::new(),
            source: String::new(),
            help: String::new(),
        }
    }

    #[test]
    fn results_have_rules_places_and_fingerprints_of_their_own() {
        let columns = Some(SourceColumns { start: 5, end: Some(9) });
        let findings = [
            finding(Some("sky,1.rmiss"), Some(7), columns),
            finding(Some("sky,1.rmiss"), Some(9), None),
            finding(Some("sky.spv"), None, None),
        ];
        let log: Value = serde_json::from_str(&findings_sarif(&findings)).expect("JSON");
        let run = &log["runs"][0];
        let rules = run["tool"]["driver"]["rules"].as_array().expect("rules");
        assert_eq!(rules.len(), rule::all().chain(rule::of_stops()).count());
        let results = run["results"].as_array().expect("results");
        for result in results {
            let index = result["ruleIndex"].as_u64().expect("an index") as usize;
            assert_eq!((&rules[index]["id"], &result["level"]), (&result["ruleId"], &json!("error")));
        }
        let places: Vec<&Value> =
            results.iter().map(|result| &result["locations"][0]["physicalLocation"]).collect();
        assert_eq!(places[0]["artifactLocation"]["uri"], "sky,1.rmiss");
        assert_eq!(places[0]["region"], json!({ "startLine": 7, "startColumn": 5, "endColumn": 9 }));
        assert_eq!(places[1]["region"], json!({ "startLine": 9 }));
        assert_eq!(
            (&places[2]["artifactLocation"]["uri"], &places[2]["region"]),
            (&json!("sky.spv"), &Value::Null)
        );
        let of = |at: usize| results[at]["partialFingerprints"][FINGERPRINT].as_str().expect("a fingerprint");
        assert!(of(0) != of(1) && of(1) != of(2) && of(0) != of(2));
        // A moved line keeps its fingerprint.
        let moved: Value =
            serde_json::from_str(&findings_sarif(&[finding(Some("sky,1.rmiss"), Some(70), None)]))
                .expect("JSON");
        assert_eq!(moved["runs"][0]["results"][0]["partialFingerprints"][FINGERPRINT], of(0));
    }
}
