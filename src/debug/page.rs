//! Lines of text with guides for nested parts, in colour or plain.

use std::fmt::Display;

/// What a piece of text means; a terminal shows it by colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// A heading.
    Head,
    /// A name.
    Name,
    /// Something kept.
    Kept,
    /// Something dropped, or of lesser interest.
    Dim,
    /// A trap.
    Trap,
}

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

    /// A piece of text as an ink shows it.
    pub fn ink(&self, ink: Ink, text: impl Display) -> String {
        if !self.colour {
            return text.to_string();
        }
        let code = match ink {
            Ink::Head => "1;36",
            Ink::Name => "33",
            Ink::Kept => "32",
            Ink::Dim => "2",
            Ink::Trap => "1;31",
        };
        format!("\u{1b}[{code}m{text}\u{1b}[0m")
    }

    /// A line.
    pub fn line(&mut self, text: impl Display) {
        let text = text.to_string();
        let guides = self.guides.concat();
        let guides = if text.is_empty() { guides.trim_end() } else { &guides };
        let line = format!("{}{}\n", self.ink_guides(guides), text.trim_end());
        self.text.push_str(&line);
    }

    /// An empty line, of which the guides remain.
    pub fn gap(&mut self) {
        self.line("");
    }

    /// Two columns, the first as wide as its widest label.
    pub fn rows<L: AsRef<str>, T: Display>(&mut self, rows: impl IntoIterator<Item = (L, T)>) {
        let rows: Vec<(L, T)> = rows.into_iter().collect();
        let width = rows.iter().map(|(label, _)| label.as_ref().chars().count()).max().unwrap_or(0);
        for (label, text) in rows {
            let label = label.as_ref();
            let pad = " ".repeat(width - label.chars().count());
            self.line(format_args!("{}{pad}  {text}", self.ink(Ink::Name, label)));
        }
    }

    /// Writes a part that stands deeper.
    pub fn nested(&mut self, guide: &'static str, write: impl FnOnce(&mut Self)) {
        self.guides.push(guide);
        write(self);
        self.guides.pop();
    }

    fn ink_guides(&self, guides: &str) -> String {
        if guides.trim().is_empty() { guides.to_owned() } else { self.ink(Ink::Dim, guides) }
    }
}

/// A count with a comma between thousands.
pub fn grouped(count: impl Into<u64>) -> String {
    let digits = count.into().to_string();
    let mut out = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_set_apart() {
        assert_eq!(grouped(0u64), "0");
        assert_eq!(grouped(999u64), "999");
        assert_eq!(grouped(30_000u64), "30,000");
        assert_eq!(grouped(1_234_567u64), "1,234,567");
    }

    #[test]
    fn rows_line_up_and_lines_end_without_blanks() {
        let mut page = Page::new(false);
        page.nested("| ", |page| {
            page.rows([("a", "1"), ("long", "")]);
            page.gap();
        });
        assert_eq!(page.finish(), "| a     1\n| long\n|\n");
    }

    #[test]
    fn colour_changes_no_letter() {
        let text = |colour| {
            let mut page = Page::new(colour);
            let text = page.ink(Ink::Kept, "kept");
            page.line(text);
            page.nested("| ", Page::gap);
            page.finish()
        };
        assert_eq!(text(true), "\u{1b}[32mkept\u{1b}[0m\n\u{1b}[2m|\u{1b}[0m\n");
        assert_eq!(text(false), "kept\n|\n");
    }
}
