//! Which bracket of a TOML text is open where a syntax error is.

/// A syntax error inside of a bracket.
pub(super) struct InBracket {
    /// The number of the error.
    pub error: usize,
    /// The offset of the innermost bracket that is open there.
    pub bracket: usize,
    /// What closes it.
    pub closing: char,
}

/// The first of some errors, given by their offsets in ascending order, at which a bracket is open.
/// The brackets of a table's header do not count: they end with their line, whatever stands there.
pub(super) fn first_in_bracket(text: &str, errors: impl Iterator<Item = usize>) -> Option<InBracket> {
    let bytes = text.as_bytes();
    let (mut at, mut open, mut is_header) = (0, Vec::new(), false);
    for (error, end) in errors.enumerate() {
        while at < end.min(bytes.len()) {
            at = match bytes[at] {
                b'#' => at + bytes[at..].iter().position(|&byte| byte == b'\n').unwrap_or(bytes.len() - at),
                b'"' | b'\'' => end_of_string(bytes, at),
                b'\n' if is_header => {
                    is_header = false;
                    open.clear();
                    at + 1
                }
                opening @ (b'[' | b'{') => {
                    is_header |= open.is_empty() && begins_line(bytes, at);
                    open.push((at, if opening == b'[' { ']' } else { '}' }));
                    at + 1
                }
                b']' | b'}' => {
                    open.pop();
                    at + 1
                }
                _ => at + 1,
            };
        }
        if let Some(&(bracket, closing)) = open.last().filter(|_| !is_header) {
            return Some(InBracket { error, bracket, closing });
        }
    }
    None
}

/// Whether nothing but blanks stands before an offset in its line.
fn begins_line(bytes: &[u8], at: usize) -> bool {
    let before = bytes[..at].iter().rev().find(|&&byte| byte != b' ' && byte != b'\t');
    before.is_none_or(|&byte| byte == b'\n')
}

/// Where a string ends that begins at an offset. One that is not closed ends with its line, or with
/// the text if it may have several.
fn end_of_string(bytes: &[u8], start: usize) -> usize {
    let quote = bytes[start];
    let triple = bytes[start..].starts_with(&[quote; 3]);
    let closing: &[u8] = if triple { &[quote; 3] } else { &[quote] };
    let mut at = start + closing.len();
    while at < bytes.len() {
        match bytes[at] {
            b'\\' if quote == b'"' => at += 1,
            b'\n' if !triple => return at,
            _ if bytes[at..].starts_with(closing) => return at + closing.len(),
            _ => {}
        }
        at += 1;
    }
    bytes.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brackets_in_strings_and_comments_are_none() {
        let found = |text: &str| {
            let found = first_in_bracket(text, [text.len()].into_iter());
            found.map(|inside| (inside.bracket, inside.closing))
        };
        assert_eq!(found("a = [1, [2], 3"), Some((4, ']')));
        assert_eq!(found("a = { b = [1]"), Some((4, '}')));
        assert_eq!(found("a = [\n[1, 2"), Some((6, ']')));
        assert_eq!(found("[a]\nb = [1"), Some((8, ']')));
        for closed in [
            "a = [1]",
            "a = '['",
            "a = \"[\\\"[\"",
            "# [",
            "a = \"\"\"[\n[\"\"\"",
            "a = '''[\n'''",
            "a = '[\n",
            "[a b",
            " [[a b",
            "[a]\n[a",
            "[a\nb = 1",
        ] {
            assert_eq!(found(closed), None, "{closed}");
        }
    }
}
