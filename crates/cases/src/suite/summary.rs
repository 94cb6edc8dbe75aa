//! A short report in Markdown, as the page of a workflow shows one.

use std::fmt::Write;

use crate::suite::{Ended, SuiteResult, report};
use anyhit_base::count::grouped;
use anyhit_base::escape;

/// The most tests and pictures that are listed: a page of GitHub holds a mebibyte.
const MOST: usize = 200;
/// The most characters of a message.
const MOST_CHARACTERS: usize = 300;

/// The totals, a table of the tests that did not pass, and the names of their pictures.
pub fn summary(result: &SuiteResult) -> String {
    let totals = report::summary(result);
    let mut out = format!("### anyhit: {}\n", markdown(totals.lines().next().unwrap_or_default()));
    let failed: Vec<_> =
        result.tests.iter().filter_map(|test| Some((test, test.problem.as_ref()?))).collect();
    if !failed.is_empty() {
        out += "\n| test | result | place | message |\n|---|---|---|---|\n";
    }
    for (test, problem) in failed.iter().take(MOST) {
        let word = if test.ended == Ended::Error { "error" } else { "failed" };
        let message: String =
            test.message.as_deref().unwrap_or_default().chars().take(MOST_CHARACTERS).collect();
        // Writing to a string does not fail.
        let _ = writeln!(
            out,
            "| {} | {word} | {}:{} | {} |",
            markdown(&test.name),
            markdown(&problem.path),
            problem.line,
            markdown(&message)
        );
    }
    if failed.len() > MOST {
        let _ = writeln!(out, "\nand {} more", grouped(failed.len() - MOST));
    }
    let pictures: Vec<&str> = failed
        .iter()
        .flat_map(|(test, _)| test.json["pictures"].as_array().into_iter().flatten())
        .filter_map(|path| path.as_str()?.rsplit(['/', '\\']).next())
        .collect();
    if !pictures.is_empty() {
        out += "\nPictures of failed comparisons, in the folder `pictures` of the reports:\n\n";
        for picture in pictures.iter().take(MOST) {
            let _ = writeln!(out, "* {}", markdown(picture));
        }
    }
    out
}

/// Text that is no markup of Markdown or HTML: punctuation as references.
fn markdown(text: &str) -> String {
    let mut out = String::new();
    for c in escape::line(text).chars() {
        match c.is_ascii_punctuation() && !matches!(c, '.' | ',' | '/' | '-' | ':') {
            true => out += &format!("&#{};", u32::from(c)),
            false => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::markdown;

    #[test]
    fn nothing_is_markup() {
        let text = "a|b <img src=x> [c](d) `e` *f*\n| g";
        let shown = markdown(text);
        assert!(!shown.contains(['|', '<', '[', '(', '`', '*', '\n']), "{shown}");
        assert_eq!(markdown("cases/a-b: 1.5, x"), "cases/a-b: 1.5, x");
    }
}
