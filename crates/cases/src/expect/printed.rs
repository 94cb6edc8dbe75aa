//! `stdout` of `[expect]`: what shaders print.

use crate::expect::Difference;
use anyhit_scene::read::{Parse, RawText, Spanned, Table, TomlValue};

/// The text that shaders must print (`debugPrintfEXT`), in launch order: a string, or a table with
/// `text` and `because`.
#[derive(Clone, Debug)]
pub struct PrintedExpectation {
    /// The text.
    pub text: Spanned<RawText>,
    /// Why this is expected.
    pub because: Option<String>,
}

impl Parse for PrintedExpectation {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if value.text().is_some() {
            return Some(Self { text: Spanned::parse(value)?, because: None });
        }
        let table = Table::new(value)?;
        let text = table.required("text");
        let because = table.optional("because");
        table.finish();
        Some(Self { text: text?, because })
    }
}

impl PrintedExpectation {
    pub(super) fn check(&self, found: &str, differences: &mut Vec<Difference>) {
        let expected = ended(&self.text.value.0);
        if expected == found {
            return;
        }
        let because = self.because.as_ref();
        let message = "the shaders print different text";
        let mut difference = Difference::new(&self.text.span, message, because).mended(
            &self.text.span,
            literal(found),
            because,
        );
        difference.error = difference.error.note_lines(diff(&expected, found));
        differences.push(difference);
    }
}

/// A text whose last line ends.
fn ended(text: &str) -> String {
    if text.is_empty() || text.ends_with('\n') { text.into() } else { format!("{text}\n") }
}

/// A text as a TOML string, of several lines where it has several.
fn literal(text: &str) -> String {
    let escaped: String = text
        .chars()
        .map(|c| match c {
            '\\' => "\\\\".into(),
            '"' => "\\\"".into(),
            '\n' => "\n".into(),
            '\t' => "\t".into(),
            c if c.is_control() => format!("\\u{:04X}", c as u32),
            c => c.to_string(),
        })
        .collect();
    match escaped.lines().count() {
        0 | 1 => format!("\"{}\"", escaped.trim_end_matches('\n').replace('\t', "\\t")),
        _ => format!("\"\"\"\n{escaped}\"\"\""),
    }
}

/// Lines around a difference that are shown.
const AROUND: usize = 2;

/// Two texts line by line: `-` is expected, `+` found. Far from differences lines are left out.
pub(crate) fn diff(expected: &str, found: &str) -> String {
    let lines: Vec<(char, &str)> = diff::lines(expected.trim_end_matches('\n'), found.trim_end_matches('\n'))
        .into_iter()
        .map(|line| match line {
            diff::Result::Left(line) => ('-', line),
            diff::Result::Both(line, _) => (' ', line),
            diff::Result::Right(line) => ('+', line),
        })
        .collect();
    let mut text = String::from("- expected, + found:");
    for (at, (sign, line)) in lines.iter().enumerate() {
        let near = &lines[at.saturating_sub(AROUND)..lines.len().min(at + AROUND + 1)];
        if near.iter().any(|(sign, _)| *sign != ' ') {
            text += &format!("\n{sign} {line}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_written_as_toml_reads_it() {
        for text in ["", "a\n", "a \"b\" \\ c\n", "one\ntwo\n\n\tthree\u{7}\n"] {
            let document = format!("x = {}", literal(text));
            let table: toml::Table = document.parse().expect("TOML");
            assert_eq!(ended(table["x"].as_str().expect("a string")), text, "{document}");
        }
    }

    #[test]
    fn a_difference_shows_its_neighbours_only() {
        let text = diff("1\n2\n3\n4\n5\n6\n", "1\n2\n3\n4\nfive\n6\n");
        assert_eq!(text, "- expected, + found:\n  3\n  4\n- 5\n+ five\n  6");
    }
}
