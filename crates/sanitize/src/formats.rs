//! Findings for other tools: JSON, annotations of GitHub, and the baseline of those that are known.

use std::fmt::Write;

use crate::record::FindingRecord;
use crate::rule::Level;
use anyhit_base::escape;
use anyhit_base::sorted::SortedSet;

/// Findings as a list of objects: `rule`, `level`, `kind`, `class`, `message`, `file`, `path`,
/// `module`, `line`, `columns`, `count`, `launch_id`, `stack`, `notes`, `source` and `help`.
pub fn json(findings: &[FindingRecord]) -> String {
    serde_json::to_string_pretty(findings).unwrap_or_default()
}

/// Findings as annotations of GitHub Actions, a line each.
pub fn github(findings: &[FindingRecord]) -> String {
    let mut text = String::new();
    for finding in findings {
        let command = if finding.level == Level::Deny { "error" } else { "warning" };
        // Writing to a string does not fail.
        let mut place = String::new();
        if let Some(path) = finding.shown_path() {
            let _ = write!(place, "file={},", escape::workflow_property(path));
        }
        if let Some(line) = finding.line {
            let _ = write!(place, "line={line},");
        }
        if let Some(columns) = finding.columns {
            let _ = write!(place, "col={},", columns.start);
        }
        let rule = escape::workflow_property(&finding.rule);
        let mut message = finding.message.clone();
        if let Some(module) = &finding.module {
            let _ = write!(message, "\nin module {module}");
        }
        let message = escape::workflow_message(&message);
        let _ = writeln!(text, "::{command} {place}title={rule}::{message}");
    }
    text
}

/// The lines of a baseline, which lists findings as known ones.
pub fn baseline(findings: &[FindingRecord]) -> String {
    let lines: SortedSet<String> = findings.iter().map(FindingRecord::baseline_line).collect();
    lines.iter().fold(String::new(), |text, line| text + line + "\n")
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
}
