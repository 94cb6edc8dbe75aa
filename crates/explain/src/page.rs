//! Lines of text with vertical guides for nested parts, coloured or plain.

use std::fmt::Display;

use anyhit_base::count::grouped;
use anyhit_base::escape;
use anyhit_base::style::Style;

/// Most guides before a line. Of more, lines have the number instead: otherwise the text of rays
/// within each other grows with the square of their depth.
const MAX_GUIDES: usize = 40;

/// A page of lines of text.
#[derive(Clone, Debug)]
pub struct Page {
    text: String,
    guides: Vec<&'static str>,
    colour: bool,
}

impl Page {
    /// An empty page.
    pub fn new(colour: bool) -> Self {
        Self { text: String::new(), guides: Vec::new(), colour }
    }

    /// Returns the text.
    pub fn finish(self) -> String {
        self.text
    }

    /// A piece of text with the escapes of a style, if the page is coloured.
    pub fn styled(&self, style: Style, text: impl Display) -> String {
        style.paint(&text.to_string(), self.colour)
    }

    /// Writes a line. Line feeds and other hidden characters in it are escapes.
    pub fn line(&mut self, text: impl Display) {
        let text = text.to_string();
        let text = if self.colour { escape::styled_line(&text) } else { escape::line(&text) };
        let mut guides = self.guides[..self.guides.len().min(MAX_GUIDES)].concat();
        if let more @ 1.. = self.guides.len().saturating_sub(MAX_GUIDES) {
            guides += &format!("(+{more}) ");
        }
        let guides = if text.is_empty() { guides.trim_end() } else { &guides };
        let line = format!("{}{}\n", self.styled_guides(guides), text.trim_end());
        self.text.push_str(&line);
    }

    /// Writes an empty line, with guides.
    pub fn blank_line(&mut self) {
        self.line("");
    }

    /// Writes two columns, the first as wide as its widest label.
    pub fn rows<L: AsRef<str>, T: Display>(&mut self, rows: impl IntoIterator<Item = (L, T)>) {
        let rows: Vec<(L, T)> = rows.into_iter().collect();
        let width = rows.iter().map(|(label, _)| label.as_ref().chars().count()).max().unwrap_or(0);
        for (label, text) in rows {
            let label = label.as_ref();
            let pad = " ".repeat(width - label.chars().count());
            self.line(format_args!("{}{pad}  {text}", self.styled(Style::Name, label)));
        }
    }

    /// Writes a nested part: its lines begin with one more guide.
    pub fn nested(&mut self, guide: &'static str, write: impl FnOnce(&mut Self)) {
        self.push_guide(guide);
        write(self);
        self.pop_guide();
    }

    /// Begins a nested part.
    pub(crate) fn push_guide(&mut self, guide: &'static str) {
        self.guides.push(guide);
    }

    /// Ends the nested part that was begun last.
    pub(crate) fn pop_guide(&mut self) {
        self.guides.pop();
    }

    fn styled_guides(&self, guides: &str) -> String {
        if guides.trim().is_empty() { guides.to_owned() } else { self.styled(Style::Faint, guides) }
    }
}

/// A count with its noun.
pub fn with_plural(count: u64, what: &str) -> String {
    format!("{} {what}{}", grouped(count), if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_line_up_and_lines_end_without_blanks() {
        let mut page = Page::new(false);
        page.nested("| ", |page| {
            page.rows([("a", "1"), ("long", "")]);
            page.blank_line();
        });
        assert_eq!(page.finish(), "| a     1\n| long\n|\n");
    }

    #[test]
    fn many_guides_are_a_number() {
        let mut page = Page::new(false);
        for depth in 0..43 {
            page.line(format_args!("{depth}"));
            page.push_guide("| ");
        }
        let text = page.finish();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "| 1");
        assert_eq!(lines[40], format!("{}40", "| ".repeat(40)));
        assert_eq!(lines[42], format!("{}(+2) 42", "| ".repeat(40)));
    }

    #[test]
    fn colour_changes_no_letter() {
        let text = |colour| {
            let mut page = Page::new(colour);
            let text = page.styled(Style::Good, "kept");
            page.line(text);
            page.nested("| ", Page::blank_line);
            page.finish()
        };
        assert_eq!(text(true), "\u{1b}[38;5;29mkept\u{1b}[0m\n\u{1b}[38;5;243m|\u{1b}[0m\n");
        assert_eq!(text(false), "kept\n|\n");
    }
}
