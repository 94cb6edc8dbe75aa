//! Findings for other tools: JSON, SARIF, annotations of GitHub, and the baseline of those that are
//! known.

use std::fmt::Write;

use serde_json::{Value, json};

use crate::record::FindingRecord;
use crate::rule::{self, Level};
use anyhit_base::escape;
use anyhit_base::sorted::SortedSet;

/// Findings as a list of objects: `rule`, `level`, `kind`, `class`, `message`, `file`, `line`,
/// `count`, `launch_id`, `stack`, `notes`, `source` and `help`.
pub fn json(findings: &[FindingRecord]) -> String {
    serde_json::to_string_pretty(findings).unwrap_or_default()
}

/// Findings as SARIF 2.1.0, one run of the tool `anyhit`.
pub fn sarif(findings: &[FindingRecord]) -> String {
    sarif_with(findings, Vec::new(), Vec::new())
}

/// As [`sarif`], with rules and results of others before those of the sanitizer.
pub fn sarif_with(findings: &[FindingRecord], mut rules: Vec<Value>, mut results: Vec<Value>) -> String {
    let own = rule::all().chain(rule::of_stops()).map(|rule| {
        json!({
            "id": rule.id,
            "shortDescription": { "text": rule.holds },
            "fullDescription": { "text": rule.source },
            "help": { "text": rule.help },
            "defaultConfiguration": { "level": sarif_level(rule.kind.default_level()) },
        })
    });
    rules.extend(own);
    results.extend(findings.iter().map(sarif_result));
    let sarif = json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": {
                "name": "anyhit",
                "version": env!("CARGO_PKG_VERSION"),
                "rules": rules,
            } },
            "results": results,
        }],
    });
    format!("{sarif:#}")
}

/// Findings as annotations of GitHub Actions, a line each.
pub fn github(findings: &[FindingRecord]) -> String {
    let mut text = String::new();
    for finding in findings {
        let command = if finding.level == Level::Deny { "error" } else { "warning" };
        let mut place = String::new();
        if let (Some(file), Some(line)) = (finding.shown_path(), finding.line) {
            // Writing to a string does not fail.
            let _ = write!(place, "file={},line={line},", escape::workflow_property(file));
        }
        let rule = escape::workflow_property(&finding.rule);
        let message = escape::workflow_message(&finding.message);
        let _ = writeln!(text, "::{command} {place}title={rule}::{message}");
    }
    text
}

/// The lines of a baseline, which lists findings as known ones.
pub fn baseline(findings: &[FindingRecord]) -> String {
    let lines: SortedSet<String> = findings.iter().map(FindingRecord::baseline_line).collect();
    lines.iter().fold(String::new(), |text, line| text + line + "\n")
}

fn sarif_level(level: Level) -> &'static str {
    match level {
        Level::Deny => "error",
        Level::Warn => "warning",
        Level::Allow => "none",
    }
}

fn sarif_result(finding: &FindingRecord) -> Value {
    let mut result = json!({
        "ruleId": finding.rule,
        "level": sarif_level(finding.level),
        "message": { "text": finding.message },
        "properties": {
            "class": finding.class,
            "count": finding.count,
            "launchId": finding.launch_id,
        },
    });
    if let (Some(file), Some(line)) = (finding.shown_path(), finding.line) {
        result["locations"] = json!([location(file, line as u64)]);
    }
    result
}

/// A line of a file as a location of SARIF.
pub fn location(path: &str, line: u64) -> Value {
    json!({
        "physicalLocation": {
            "artifactLocation": { "uri": uri(path) },
            "region": { "startLine": line },
        },
    })
}

/// A path as SARIF has it (3.4.3): relative to the repository's root, or of the file system.
fn uri(path: &str) -> String {
    match path.starts_with('/') {
        true => format!("file://{}", escape::uri(path)),
        false => escape::uri(path),
    }
}

#[cfg(test)]
mod tests {
    use pretty_assertions::assert_eq;

    use super::*;
    use crate::finding::{Finding, FindingKey, Findings};
    use crate::rule::{Rule, arithmetic};
    use anyhit_base::error::{Error, ErrorKind, Place};
    use anyhit_engine::machine::ShaderIndex;

    fn findings() -> Findings {
        let mut all = Findings::default();
        let mut add = |rule: &'static Rule, line: u32, message: &str| {
            let place = Place::Line { file: "sky,1.rmiss".into(), line, column: 0 };
            let error = Error::new(ErrorKind::Finding, message).at(place);
            let level = rule.kind.default_level();
            let finding = Finding { rule, level, count: 0, launch_id: [3, 2, 0], stack: Vec::new(), error };
            let key = FindingKey { rule: rule.id, places: [(ShaderIndex(0), line), (ShaderIndex(0), 0)] };
            all.add(key, 2, Some(finding));
            // Met again: it is counted.
            all.add(key, 1, None);
        };
        add(&arithmetic::POW_DOMAIN, 7, "pow(-1.0, 2.0)");
        add(&arithmetic::NAN_OUTPUT, 9, "a NaN: 100 %");
        all
    }

    #[test]
    fn annotations_escape_what_github_reads_otherwise() {
        let expected = "::error file=sky%2C1.rmiss,line=7,title=pow-domain::pow(-1.0, 2.0)\n\
                        ::warning file=sky%2C1.rmiss,line=9,title=nan-output::a NaN: 100 %25\n";
        assert_eq!(github(&findings().records()), expected);
    }

    #[test]
    fn a_baseline_forgets_what_it_lists_wherever_it_stands() {
        let mut later = findings();
        later.forget_known("pow-domain\tsky,1.rmiss\tpow(-1.0, 2.0)\n");
        let left: Vec<(&str, u64)> = later.iter().map(|finding| (finding.rule.id, finding.count)).collect();
        assert_eq!(left, [("nan-output", 3)]);
        // What is left is still found by its key.
        let mut both = later.clone();
        both.extend(findings());
        assert_eq!(both.iter().map(|finding| finding.count).collect::<Vec<_>>(), [6, 3]);
        let known = baseline(&findings().records());
        later.forget_known(&known);
        assert!(later.is_empty());
    }

    #[test]
    fn sarif_has_rules_results_and_places() {
        let sarif: Value = serde_json::from_str(&sarif(&findings().records())).expect("JSON");
        let run = &sarif["runs"][0];
        assert_eq!(sarif["version"], "2.1.0");
        assert_eq!(
            run["tool"]["driver"]["rules"].as_array().map(Vec::len),
            Some(rule::all().chain(rule::of_stops()).count())
        );
        let result = &run["results"][0];
        assert_eq!((&result["ruleId"], &result["level"]), (&json!("pow-domain"), &json!("error")));
        let place = &result["locations"][0]["physicalLocation"];
        assert_eq!(place["artifactLocation"]["uri"], "sky,1.rmiss");
        assert_eq!(place["region"]["startLine"], 7);
        let json: Value = serde_json::from_str(&super::json(&findings().records())).expect("JSON");
        assert_eq!(
            (&json[1]["level"], &json[1]["line"], &json[1]["count"]),
            (&json!("warn"), &json!(9), &json!(3))
        );
    }
}
