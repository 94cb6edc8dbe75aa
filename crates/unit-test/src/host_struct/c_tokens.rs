//! Tokens of C and C++.

use std::ops::Range;

/// A token: its text and its place in the file.
#[derive(Clone, Debug)]
pub(super) struct Token {
    pub(super) text: String,
    pub(super) span: Range<usize>,
    /// First of its line.
    pub(super) starts_line: bool,
}

impl Token {
    pub(super) fn is(&self, text: &str) -> bool {
        self.text == text
    }

    pub(super) fn is_name(&self) -> bool {
        self.text.starts_with(|letter: char| letter == '_' || letter.is_alphabetic())
    }
}

/// The tokens of a text: names, numbers, quoted texts and single characters of punctuation, but for
/// `::`, `<<`, `>>`, `&&`, `||` and comparisons. Comments and joined lines are left out.
pub(super) fn tokens(text: &str) -> Vec<Token> {
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let (mut at, mut starts_line) = (0, true);
    while let Some(&byte) = bytes.get(at) {
        let rest = &text[at..];
        if byte == b'\n' {
            starts_line = true;
            at += 1;
        } else if rest.starts_with("\\\n") || rest.starts_with("\\\r\n") {
            at += rest.find('\n').unwrap_or(0) + 1;
        } else if byte.is_ascii_whitespace() {
            at += 1;
        } else if rest.starts_with("//") {
            at += line_end(rest);
        } else if let Some(comment) = rest.strip_prefix("/*") {
            let end = comment.find("*/").map_or(rest.len(), |end| end + 4);
            starts_line |= rest[..end].contains('\n');
            at += end;
        } else {
            let length = length(rest);
            let span = at..at + length;
            found.push(Token { text: text[span.clone()].to_owned(), span, starts_line });
            starts_line = false;
            at += length;
        }
    }
    found
}

/// Bytes up to the end of a line, which a backslash continues.
fn line_end(text: &str) -> usize {
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        at += line.len();
        let line = line.trim_end_matches(['\n', '\r']);
        if !line.ends_with('\\') {
            return at - usize::from(text[..at].ends_with('\n'));
        }
    }
    at
}

/// The length of the first token in bytes.
fn length(text: &str) -> usize {
    let first = text.chars().next().unwrap_or(' ');
    let name = |letter: char| letter == '_' || letter.is_alphanumeric();
    if name(first) {
        // Numbers too: `1.0f`, `0x10`, `1'000`.
        let is_number = first.is_ascii_digit();
        let part = |letter: char| name(letter) || is_number && (letter == '.' || letter == '\'');
        return text.find(|letter: char| !part(letter)).unwrap_or(text.len());
    }
    if first == '"' || first == '\'' {
        let mut is_escaped = false;
        for (at, letter) in text.char_indices().skip(1) {
            match letter {
                '\n' => return at,
                _ if is_escaped => is_escaped = false,
                '\\' => is_escaped = true,
                _ if letter == first => return at + 1,
                _ => {}
            }
        }
        return text.len();
    }
    let pairs = ["::", "<<", ">>", "&&", "||", "==", "!=", "<=", ">=", "[[", "]]", "##"];
    if pairs.iter().any(|pair| text.starts_with(pair)) { 2 } else { first.len_utf8() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_joined_lines_are_left_out() {
        let text = "int a; // b \\\n c\n/* d\n */ float\\\n x = 0x10u + 1'000;\n'\\'' \"q // r\"";
        let all: Vec<_> = tokens(text).into_iter().map(|token| token.text).collect();
        assert_eq!(
            all,
            ["int", "a", ";", "float", "x", "=", "0x10u", "+", "1'000", ";", "'\\''", "\"q // r\""]
        );
    }

    #[test]
    fn any_text_ends() {
        for text in ["\"", "'", "/*", "\\", "\\\n", "a::b>>c", "\u{e9}\u{20ac}", "\"\\"] {
            let _ = tokens(text);
        }
    }
}
