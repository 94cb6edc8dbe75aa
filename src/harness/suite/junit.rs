//! The suite as JUnit XML, in the form that CI engines read: a `testsuite` for each file.

use std::fmt::Write;
use std::time::Duration;

use crate::harness::suite::{Finished, Outcome, Report, tell};

/// The XML.
pub fn junit(report: &Report) -> String {
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    // Writing to a string does not fail.
    let _ = writeln!(out, "<testsuites name=\"anyhit\" {}>", counts(&report.finished));
    for group in report.finished.chunk_by(|one, next| one.file == next.file) {
        let name = attribute(&group[0].file.display().to_string());
        let _ = writeln!(out, "  <testsuite name=\"{name}\" {}>", counts(group));
        for finished in group {
            case(&mut out, finished);
        }
        out.push_str("  </testsuite>\n");
    }
    out.push_str("</testsuites>\n");
    out
}

fn counts(tests: &[Finished]) -> String {
    let count = |wanted: fn(&Outcome) -> bool| tests.iter().filter(|test| wanted(&test.outcome)).count();
    let failures = count(|outcome| matches!(outcome, Outcome::Failed(_)));
    let errors = count(|outcome| matches!(outcome, Outcome::Broken(_)));
    let time: Duration = tests.iter().map(|test| test.took).sum();
    format!(
        "tests=\"{}\" failures=\"{failures}\" errors=\"{errors}\" skipped=\"0\" time=\"{:.6}\"",
        tests.len(),
        time.as_secs_f64()
    )
}

fn case(out: &mut String, finished: &Finished) {
    let name = attribute(&finished.name);
    let _ = write!(out, "    <testcase name=\"{name}\" time=\"{:.6}\"", finished.took.as_secs_f64());
    let (element, error) = match &finished.outcome {
        Outcome::Passed | Outcome::Renewed => {
            out.push_str("/>\n");
            return;
        }
        Outcome::KnownFailure(why) => {
            let why = content(&format!("known failure: {why}"));
            let _ = writeln!(out, "><system-out>{why}</system-out></testcase>");
            return;
        }
        Outcome::Failed(failure) => ("failure", failure.errors.first()),
        Outcome::Broken(error) => ("error", Some(error)),
    };
    let message = attribute(error.map_or("not as expected", |error| error.message()));
    let text = content(&tell::text(finished, false));
    let kind = finished.outcome.word();
    let _ = writeln!(
        out,
        ">\n      <{element} message=\"{message}\" type=\"{kind}\">{text}</{element}>\n    </testcase>"
    );
}

/// Text between tags. Characters that XML 1.0 cannot hold become U+FFFD.
fn content(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '\n' | '\t' => out.push(c),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c if c.is_control() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// Text in an attribute: lines stay lines there.
fn attribute(text: &str) -> String {
    content(text).replace('"', "&quot;").replace('\n', "&#10;").replace('\t', "&#9;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_xml_cannot_hold_is_escaped_or_replaced() {
        assert_eq!(content("a < b && c > d\u{1b}[1m\n"), "a &lt; b &amp;&amp; c &gt; d\u{fffd}[1m\n");
        assert_eq!(attribute("\"a\"\nb\t"), "&quot;a&quot;&#10;b&#9;");
    }
}
